"""The policies that are compared, by name."""

from .baselines import LQR, LinearPolicy, OnVehicle
from .contenders import (
    CONTENDERS,
    AnyPolicy,
    Contender,
    available,
    contender,
    label_of,
    require_own,
)

__all__ = [
    "CONTENDERS",
    "LQR",
    "AnyPolicy",
    "Contender",
    "LinearPolicy",
    "OnVehicle",
    "available",
    "contender",
    "label_of",
    "require_own",
]
