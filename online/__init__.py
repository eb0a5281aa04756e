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
from .loop import Feedback, FunctionPolicy, History, LearnedPolicy, Policy, RunSettings
from .paper import rank_margin
from .records import load, load_weights, save, to_dataset
from .rows import draw_samples
from .simulate import simulate
from .vehicle import (
    Allocation,
    Allocator,
    Controller,
    DisturbanceObserver,
    DisturbanceSettings,
    NoiseSettings,
    SimulationSettings,
    VehicleHistory,
    VehiclePolicy,
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
    "Feedback",
    "FunctionPolicy",
    "History",
    "LearnedPolicy",
    "Learner",
    "LearnerSettings",
    "LearnerStep",
    "Monitor",
    "MonitorSample",
    "NoiseSettings",
    "Policy",
    "RunSettings",
    "SampleSettings",
    "SimulationSettings",
    "VehicleHistory",
    "VehiclePolicy",
    "build_disturbance",
    "draw_samples",
    "load",
    "load_weights",
    "rank_margin",
    "run",
    "save",
    "simulate",
    "to_dataset",
]
