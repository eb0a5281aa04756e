"""Certified optima from many states, and the ideal weights that fit them."""

from .ideal import (
    HELD_OUT,
    SIZES,
    TRAINING,
    Bounds,
    Ideal,
    certified_pairs,
    envelope_states,
    fit,
    ideal_record,
    load_ideal,
    require_numbers,
)
from .optima import CERTIFICATE, Optima, record_path, unit_text

__all__ = [
    "CERTIFICATE",
    "HELD_OUT",
    "SIZES",
    "TRAINING",
    "Bounds",
    "Ideal",
    "Optima",
    "certified_pairs",
    "envelope_states",
    "fit",
    "ideal_record",
    "load_ideal",
    "record_path",
    "require_numbers",
    "unit_text",
]
