"""Online learning: Bellman error, critic and actor laws, the controller and the closed loop."""

from .allocation import Allocation, Allocator
from .closed_loop import History, Policy, run
from .controller import Controller
from .disturbance import build_disturbance
from .learner import Learner
from .learner_step import LearnerStep
from .monitor import Look, Monitor
from .observer import DisturbanceObserver
from .record import load, load_weights, save, to_dataset
from .samples import draw_samples, rank_margin
from .settings import (
    DisturbanceSettings,
    LearnerSettings,
    NoiseSettings,
    SampleSettings,
    SimulationSettings,
)

__all__ = [
    "Allocation",
    "Allocator",
    "Controller",
    "DisturbanceObserver",
    "DisturbanceSettings",
    "History",
    "Learner",
    "LearnerSettings",
    "LearnerStep",
    "Look",
    "Monitor",
    "NoiseSettings",
    "Policy",
    "SampleSettings",
    "SimulationSettings",
    "build_disturbance",
    "draw_samples",
    "load",
    "load_weights",
    "rank_margin",
    "run",
    "save",
    "to_dataset",
]
