"""Comparison of the learned policy with the offline optimum."""

from .adapters import export
from .compare import Study, compare
from .records import Replay, replay
from .scenario import Scenario, generate
from .sweep import SweepResult, sweep
from .theory import Condition, check

__all__ = [
    "Condition",
    "Replay",
    "Scenario",
    "Study",
    "SweepResult",
    "check",
    "compare",
    "export",
    "generate",
    "replay",
    "sweep",
]
