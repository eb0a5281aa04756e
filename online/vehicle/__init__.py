"""A vehicle in closed loop: controller, plant, disturbance, sensors and thrusters."""

from .allocation import Allocation, Allocator, require_trim, shown_trim, trim_share
from .controller import Controller
from .disturbance import Disturbance, KnownSource, build_disturbance
from .history import VehicleHistory
from .loop import VehiclePolicy, run
from .measurement import Flag, Flags, Limits, MeasurementGate, require_dt, require_measurement
from .noise import MeasurementNoise
from .observer import DisturbanceObserver
from .plant import HeldPlant, held_rates
from .settings import DisturbanceSettings, NoiseSettings, SimulationSettings

__all__ = [
    "Allocation",
    "Allocator",
    "Controller",
    "Disturbance",
    "DisturbanceObserver",
    "DisturbanceSettings",
    "Flag",
    "Flags",
    "HeldPlant",
    "KnownSource",
    "Limits",
    "MeasurementGate",
    "MeasurementNoise",
    "NoiseSettings",
    "SimulationSettings",
    "VehicleHistory",
    "VehiclePolicy",
    "build_disturbance",
    "held_rates",
    "require_dt",
    "require_measurement",
    "require_trim",
    "run",
    "shown_trim",
    "trim_share",
]
