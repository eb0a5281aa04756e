"""The learner, its safeguard, what it remembers, and what is watched of it."""

from .learner import Learner
from .learner_step import LearnerStep
from .monitor import Monitor, MonitorSample
from .settings import AS_PRINTED, LearnerSettings, SampleSettings

__all__ = [
    "AS_PRINTED",
    "Learner",
    "LearnerSettings",
    "LearnerStep",
    "Monitor",
    "MonitorSample",
    "SampleSettings",
]
