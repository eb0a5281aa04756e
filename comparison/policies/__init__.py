"""The policies that are compared, by name."""

from .baselines import LQR, Baseline, LinearPolicy
from .contenders import CONTENDERS, contender

__all__ = ["CONTENDERS", "LQR", "Baseline", "LinearPolicy", "contender"]
