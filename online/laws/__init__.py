"""The laws (19)-(21) over a step: critic and actors, exact with frozen rows."""

from .actor import actor_step
from .critic import Critic, Gradient, LeastSquares
from .equations import Equations, NormalEquations, Normalizer, exact_flow, row_weights

__all__ = [
    "Critic",
    "Equations",
    "Gradient",
    "LeastSquares",
    "NormalEquations",
    "Normalizer",
    "actor_step",
    "exact_flow",
    "row_weights",
]
