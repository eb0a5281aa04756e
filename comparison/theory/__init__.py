"""The paper's assumptions, conditions and theorem with their numbers."""

from .conditions import Condition, check
from .run_conditions import run_conditions
from .theory import Theory, require_run, theory

__all__ = ["Condition", "Theory", "check", "require_run", "run_conditions", "theory"]
