"""A vehicle in closed loop: controller, plant, disturbance, sensors and thrusters."""

from .allocation import Allocation, Allocator
from .controller import Controller, fixed_points
from .disturbance import Disturbance, KnownSource, build_disturbance
from .history import History
from .loop import Policy, Progress, run
from .noise import MeasurementNoise
from .observer import DisturbanceObserver
from .plant import HeldPlant, PlantState, held_rates
from .settings import DisturbanceSettings, NoiseSettings, SimulationSettings

__all__ = [
    "Allocation",
    "Allocator",
    "Controller",
    "Disturbance",
    "DisturbanceObserver",
    "DisturbanceSettings",
    "HeldPlant",
    "History",
    "KnownSource",
    "MeasurementNoise",
    "NoiseSettings",
    "PlantState",
    "Policy",
    "Progress",
    "SimulationSettings",
    "build_disturbance",
    "fixed_points",
    "held_rates",
    "run",
]
