"""The learner, its safeguard, what it remembers, and what is watched of it."""

from .learner import Learner
from .learner_step import LearnerStep
from .monitor import Look, Monitor
from .settings import LearnerSettings, SampleSettings

__all__ = ["Learner", "LearnerSettings", "LearnerStep", "Look", "Monitor", "SampleSettings"]
