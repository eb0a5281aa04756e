"""Symbolic models: vehicles, earth-frame dynamics, the game, bases, and their compiled functions."""

from .basis import Basis, drag, drag_cubic, find_function, quadratic
from .errors import GammaTooSmallError, InputError, RunError, StationkeepError
from .game import Game
from .kernel import Export, Kernel
from .model import Model, require_pitch, require_state
from .prediction import Path, Prediction, growing_steps
from .problem import InverseDynamics, Problem, closed_form_problem
from .riccati import game_riccati, gamma_hamiltonian, gamma_star
from .station import StationKeeping
from .value import PointTerms, ValueFunctions
from .vehicle import Thrusters, Vehicle

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
