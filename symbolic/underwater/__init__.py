"""Underwater vehicles (1)-(3): parameters, kinematics, dynamics, and the problem that they make."""

from .dynamics import acceleration, earth_frame, inverse_dynamics
from .kinematics import jacobian, jacobian_inverse
from .model import (
    ANGLES,
    FORCE_NAMES,
    STATE_NAMES,
    Model,
    require_pitch,
    require_pitch_within,
    require_vehicle_state,
    vehicle_initial_state,
)
from .station import StationKeeping
from .thrusters import Thrusters
from .vehicle import Vehicle

__all__ = [
    "ANGLES",
    "FORCE_NAMES",
    "STATE_NAMES",
    "Model",
    "StationKeeping",
    "Thrusters",
    "Vehicle",
    "acceleration",
    "earth_frame",
    "inverse_dynamics",
    "jacobian",
    "jacobian_inverse",
    "require_pitch",
    "require_pitch_within",
    "require_vehicle_state",
    "vehicle_initial_state",
]
