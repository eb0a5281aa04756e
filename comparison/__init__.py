"""Comparison of the learned policy with the offline optimum."""

from .scenario import Scenario
from .study import Comparison, compare
from .theory import Condition, check

__all__ = ["Comparison", "Condition", "Scenario", "check", "compare"]
