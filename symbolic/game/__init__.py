"""The zero-sum game (4)-(9): weights, Riccati equation, and the problem of a game on a plant."""

from .game import Game, gamma_threshold, weight_matrix
from .problem import InverseDynamics, Problem, closed_form_problem
from .riccati import game_riccati, gamma_hamiltonian, gamma_star, stabilising_solution

__all__ = [
    "Game",
    "InverseDynamics",
    "Problem",
    "closed_form_problem",
    "game_riccati",
    "gamma_hamiltonian",
    "gamma_star",
    "gamma_threshold",
    "stabilising_solution",
    "weight_matrix",
]
