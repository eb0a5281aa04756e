"""Online learning: Bellman error, critic and actor laws, the controller and the closed loop."""

from .laws import Critic
from .learning import (
    AS_PRINTED,
    Learner,
    LearnerSettings,
    LearnerStep,
    Monitor,
    MonitorSample,
    SampleSettings,
)
from .paper import rank_margin
from .records import load, load_weights, save, to_dataset
from .rows import draw_samples
from .vehicle import (
    Allocation,
    Allocator,
    Controller,
    DisturbanceObserver,
    DisturbanceSettings,
    History,
    NoiseSettings,
    Policy,
    SimulationSettings,
    build_disturbance,
    run,
)

__all__ = [
    "AS_PRINTED",
    "Allocation",
    "Allocator",
    "Controller",
    "Critic",
    "DisturbanceObserver",
    "DisturbanceSettings",
    "History",
    "Learner",
    "LearnerSettings",
    "LearnerStep",
    "Monitor",
    "MonitorSample",
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
