"""The learner, its safeguard, what it remembers, and what is watched of it."""

from .learner import Learner
from .learner_step import LearnerStep
from .monitor import Monitor, MonitorSample
from .pace import learning_period, paid_share
from .settings import AS_PRINTED, PERIOD, RULES, LearnerSettings, SampleSettings

__all__ = [
    "AS_PRINTED",
    "PERIOD",
    "RULES",
    "Learner",
    "LearnerSettings",
    "LearnerStep",
    "Monitor",
    "MonitorSample",
    "SampleSettings",
    "learning_period",
    "paid_share",
]
