"""The problem that every contender solves, its mesh, and a starting guess that is cheap to evaluate.

    minimise over v  the integral over [0, T] of ζ'Q ζ + v'R_eff v,  plus ζ(T)'P ζ(T)
    subject to  ζ_dot = f(ζ) + g(ζ) v,  ζ(0) = ζ_0

is the single-player equivalent of the reference game; P is its Riccati solution at the origin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import casadi
import numpy as np
from casadi import DM, SX
from scipy.linalg import expm
from stationkeep.offline import MeshSettings
from stationkeep.symbolic import Problem
from stationkeep.symbolic.arrays import Array

Solve = Callable[[Array], float]


@dataclass(frozen=True)
class Mesh(MeshSettings):
    """Intervals that grow geometrically from t = 0, and the points on them."""

    def __str__(self) -> str:
        return f"{self.n_intervals} x {self.degree}, {self.grading:g}, {self.horizon:g} s"

    def times(self, nodes: Array) -> Array:
        """Return the times of `nodes` in (0, 1] on every interval, shape (K len(nodes),) [s]."""
        return np.concatenate([a + (b - a) * nodes for a, b in pairwise(self.points)])


def point_function(problem: Problem) -> casadi.Function:
    """Return (ζ, v) -> ζ_dot and the running cost, made of scalar operations."""
    zeta, v = problem.zeta, SX.sym("v", problem.n_inputs)
    Q, R_eff = DM(problem.game.Q), DM(problem.game.R_eff)
    rate = problem.drift + problem.input_matrix @ v
    return casadi.Function("point", [zeta, v], [rate, zeta.T @ Q @ zeta + v.T @ R_eff @ v])


class LinearGuess:
    """The linearised closed loop ζ(t) = e^((A + B F) t) ζ_0, v = F ζ, at times known in advance."""

    def __init__(self, problem: Problem, times: Array) -> None:
        A, B = problem.linearization
        self._policy = -problem.game.R_eff_inverse @ B.T @ problem.P
        self._transitions = np.array([expm((A + B @ self._policy) * t) for t in times])

    def __call__(self, zeta0: Array) -> tuple[Array, Array]:
        """Return states (m, n) and inputs (m, k) at the m times."""
        states = self._transitions @ zeta0
        return states, states @ self._policy.T
