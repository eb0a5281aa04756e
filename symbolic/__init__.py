"""Symbolic models: vehicles, earth-frame dynamics, the game, bases, and their compiled functions."""

from .compiled import Export, Kernel
from .errors import GammaTooSmallError, InputError, RunError, StationkeepError
from .game import (
    Bound,
    Game,
    InverseDynamics,
    Problem,
    game_riccati,
    gamma_hamiltonian,
    gamma_star,
)
from .textbook import two_state_game
from .underwater import Model, StationKeeping, Thrusters, Vehicle, require_pitch, require_vehicle_state
from .value import (
    Basis,
    PointTerms,
    PredictedPath,
    Prediction,
    Setup,
    ValueFunctions,
    drag,
    drag_cubic,
    find_function,
    growing_steps,
    quadratic,
)

__all__ = [
    "Basis",
    "Bound",
    "Export",
    "Game",
    "GammaTooSmallError",
    "InputError",
    "InverseDynamics",
    "Kernel",
    "Model",
    "PointTerms",
    "PredictedPath",
    "Prediction",
    "Problem",
    "RunError",
    "Setup",
    "StationKeeping",
    "StationkeepError",
    "Thrusters",
    "ValueFunctions",
    "Vehicle",
    "drag",
    "drag_cubic",
    "find_function",
    "game_riccati",
    "gamma_hamiltonian",
    "gamma_star",
    "growing_steps",
    "quadratic",
    "require_pitch",
    "require_vehicle_state",
    "two_state_game",
]
