"""Symbolic models: vehicles, earth-frame dynamics, the game, bases, and their compiled functions."""

from .compiled import Export, Kernel
from .errors import GammaTooSmallError, InputError, RunError, StationkeepError
from .game import (
    Game,
    InverseDynamics,
    Problem,
    closed_form_problem,
    game_riccati,
    gamma_hamiltonian,
    gamma_star,
)
from .underwater import Model, StationKeeping, Thrusters, Vehicle, require_pitch, require_state
from .value import (
    Basis,
    Path,
    PointTerms,
    Prediction,
    ValueFunctions,
    drag,
    drag_cubic,
    find_function,
    growing_steps,
    quadratic,
)

__all__ = [
    "Basis",
    "Export",
    "Game",
    "GammaTooSmallError",
    "InputError",
    "InverseDynamics",
    "Kernel",
    "Model",
    "Path",
    "PointTerms",
    "Prediction",
    "Problem",
    "RunError",
    "StationKeeping",
    "StationkeepError",
    "Thrusters",
    "ValueFunctions",
    "Vehicle",
    "closed_form_problem",
    "drag",
    "drag_cubic",
    "find_function",
    "game_riccati",
    "gamma_hamiltonian",
    "gamma_star",
    "growing_steps",
    "quadratic",
    "require_pitch",
    "require_state",
]
