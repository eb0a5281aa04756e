"""Comparison of the learned policy with the offline optimum."""

from .adapters import export
from .records import Replay, replay
from .scenario import Scenario, generate
from .study import Comparison, compare
from .sweep import Swept, sweep
from .theory import Condition, check

__all__ = [
    "Comparison",
    "Condition",
    "Replay",
    "Scenario",
    "Swept",
    "check",
    "compare",
    "export",
    "generate",
    "replay",
    "sweep",
]
