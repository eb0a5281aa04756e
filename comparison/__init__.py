"""Comparison of the learned policy with the offline optimum."""

from .scenario import Scenario

__all__ = ["Scenario"]
