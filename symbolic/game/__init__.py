"""The zero-sum game (4)-(9): weights, Riccati equation, and the problem of a game on a plant."""

from .angles import Angles, AngleTracker, Equivalence
from .checks import InverseDynamics
from .domain import Bound, margins_and_shown, outside, require_numbers, require_time_step
from .game import Game, gamma_threshold, weight_matrix
from .problem import Problem
from .riccati import game_riccati, gamma_hamiltonian, gamma_star, stabilising_solution
from .sampled import (
    MEAN_FROM,
    HeldLoop,
    can_hold,
    fastest_mode,
    held_loop,
    longest_hold,
    longest_period,
    mean_matrix,
)
from .stored import problem_from_data, problem_to_data

__all__ = [
    "MEAN_FROM",
    "AngleTracker",
    "Angles",
    "Bound",
    "Equivalence",
    "Game",
    "HeldLoop",
    "InverseDynamics",
    "Problem",
    "can_hold",
    "fastest_mode",
    "game_riccati",
    "gamma_hamiltonian",
    "gamma_star",
    "gamma_threshold",
    "held_loop",
    "longest_hold",
    "longest_period",
    "margins_and_shown",
    "mean_matrix",
    "outside",
    "problem_from_data",
    "problem_to_data",
    "require_numbers",
    "require_time_step",
    "stabilising_solution",
    "weight_matrix",
]
