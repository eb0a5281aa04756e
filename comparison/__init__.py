"""Comparison of the learned policy with the offline optimum."""

from .compare import Study, compare
from .scenario import Scenario
from .theory import Condition, check

__all__ = ["Condition", "Scenario", "Study", "check", "compare"]
