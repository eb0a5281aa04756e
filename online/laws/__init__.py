"""The laws (19)-(21): critic and actors, exact over a step with frozen rows."""

from .actor import actor_step
from .critic import (
    Equations,
    LeastSquares,
    NormalEquations,
    Normalizer,
    exact_flow,
    gradient_step,
    row_weights,
)
from .vector_code import library

__all__ = [
    "Equations",
    "LeastSquares",
    "NormalEquations",
    "Normalizer",
    "actor_step",
    "exact_flow",
    "gradient_step",
    "library",
    "row_weights",
]
