"""The closed loop of any problem: plant, policies, and what a run records."""

from .feedback import Feedback, FunctionPolicy
from .held import HeldRates
from .history import History
from .hold import MeanState, require_held
from .loop import Progress, System, drive
from .plant import PlantState, ProblemPlant
from .policy import LearnedPolicy, LearnerScenario, Policy, fixed_points
from .problem_system import Disturbance, ProblemSystem
from .settings import RunSettings

__all__ = [
    "Disturbance",
    "Feedback",
    "FunctionPolicy",
    "HeldRates",
    "History",
    "LearnedPolicy",
    "LearnerScenario",
    "MeanState",
    "PlantState",
    "Policy",
    "ProblemPlant",
    "ProblemSystem",
    "Progress",
    "RunSettings",
    "System",
    "drive",
    "fixed_points",
    "require_held",
]
