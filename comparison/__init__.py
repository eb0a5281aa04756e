"""Comparison of the learned policy with the offline optimum."""

from .compare import Comparison, compare
from .conditions import Condition, check
from .scenario import Scenario

__all__ = ["Comparison", "Condition", "Scenario", "check", "compare"]
