"""A comparison: every policy and the optimum from the same states."""

from .analysis import Field
from .compare import Comparison, Plan, compare
from .excitation import ExcitationRun

__all__ = ["Comparison", "ExcitationRun", "Field", "Plan", "compare"]
