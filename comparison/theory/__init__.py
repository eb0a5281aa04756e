"""The paper's assumptions, conditions and theorem with their numbers."""

from .check import check
from .condition import Condition
from .conditions import scenario_conditions
from .run_conditions import run_conditions
from .theory import Theory, require_run, theory

__all__ = [
    "Condition",
    "Theory",
    "check",
    "require_run",
    "run_conditions",
    "scenario_conditions",
    "theory",
]
