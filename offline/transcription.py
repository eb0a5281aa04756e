"""Legendre-Gauss-Radau collocation of the single-player equivalent as a nonlinear program.

    minimise  Σ_i h_i Σ_j b_j L(X_ij, v_ij) + ζ(T)'P ζ(T),      L = ζ'Qζ + v'R_eff v
    subject to  Σ_l c_lj X_il = h_i (f(X_ij) + g(X_ij) v_ij),   ζ(0) = ζ_0

on intervals of length h_i with d Radau points, the last of which is the interval's end. The degree d
rule integrates polynomials of degree 2d - 2 exactly (Kameswaran and Biegler 2008; Garg et al. 2010).
One interval's function is expanded to scalar operations and mapped over the mesh; the lengths h_i
are parameters, so a mesh of as many intervals reuses the program.
"""

from __future__ import annotations

from functools import cached_property

import casadi
import numpy as np
from casadi import DM, MX, SX

from ..symbolic import Problem
from ..symbolic.vehicle import Array
from .radau import RadauRule


class Transcription:
    """The nonlinear program for a problem on a mesh of K intervals of degree d.

    Build once, solve from many initial states.
    """

    def __init__(self, problem: Problem, n_intervals: int, degree: int) -> None:
        self.problem = problem
        self.n_intervals = n_intervals
        self.rule = RadauRule(degree)
        self.n_points = n_intervals * degree

    @cached_property
    def solver(self) -> casadi.Function:
        """IPOPT on the program; parameters are ζ_0 (n,) and h (K,)."""
        n, k, K = self.problem.n_states, self.problem.n_inputs, self.n_intervals
        d = self.rule.degree
        start = MX.sym("start", n)
        states = MX.sym("states", n, self.n_points)
        inputs = MX.sym("inputs", k, self.n_points)
        zeta0, lengths = MX.sym("zeta0", n), MX.sym("lengths", K)
        ends = states[:, d - 1 :: d]
        starts = casadi.horzcat(start, ends[:, :-1]) if K > 1 else start
        mapped = self._interval().map(K, "serial") if K > 1 else self._interval()
        cost, defects = mapped(
            starts, casadi.reshape(states, n * d, K), casadi.reshape(inputs, k * d, K), lengths.T
        )
        final = ends[:, -1]
        program = {
            "x": casadi.veccat(start, states, inputs),
            "p": casadi.vertcat(zeta0, lengths),
            "f": casadi.sum2(cost) + final.T @ DM(self.problem.P) @ final,
            "g": casadi.vertcat(start - zeta0, casadi.vec(defects)),
        }
        options = {
            "print_time": False,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "tol": 1e-10,
                "constr_viol_tol": 1e-10,
                "acceptable_iter": 0,
                "max_iter": 200,
                "mu_init": 1e-9,
            },
        }
        return casadi.nlpsol("direct", "ipopt", program, options)  # type: ignore[arg-type]

    def pack(self, start: Array, states: Array, inputs: Array) -> Array:
        """Return the unknowns from ζ(0) (n,), states (K d, n) and inputs (K d, k)."""
        return np.concatenate([start, states.ravel(), inputs.ravel()])

    def unpack(self, unknowns: Array) -> tuple[Array, Array]:
        """Return states (K d + 1, n), ζ(0) first, and inputs (K d, k)."""
        n, k = self.problem.n_states, self.problem.n_inputs
        split = n * (self.n_points + 1)
        return unknowns[:split].reshape(-1, n), unknowns[split:].reshape(-1, k)

    def times(self, mesh: Array) -> Array:
        """Return the collocation times, shape (K d,) [s]."""
        return np.asarray((mesh[:-1, None] + np.diff(mesh)[:, None] * self.rule.nodes).ravel())

    def _interval(self) -> casadi.Function:
        """Cost and defects of one interval, expanded to scalar operations."""
        problem, d = self.problem, self.rule.degree
        n, k = problem.n_states, problem.n_inputs
        derivative, weights = self.rule.coefficients
        point = self._point()
        start, h = SX.sym("start", n), SX.sym("h")
        states, inputs = SX.sym("states", n, d), SX.sym("inputs", k, d)
        slopes = casadi.horzcat(start, states) @ DM(derivative)
        cost, defects = SX(0), []
        for j in range(d):
            rate, running = point(states[:, j], inputs[:, j])
            defects.append(slopes[:, j] - h * rate)
            cost += h * weights[j] * running
        return casadi.Function(
            "interval",
            [start, casadi.vec(states), casadi.vec(inputs), h],
            [cost, casadi.vertcat(*defects)],
        )

    def _point(self) -> casadi.Function:
        """ζ_dot and L at one point."""
        problem = self.problem
        zeta, v = problem.zeta, SX.sym("v", problem.n_inputs)
        rate = problem.drift + problem.input_matrix @ v
        Q, R_eff = DM(problem.game.Q), DM(problem.game.R_eff)
        return casadi.Function("point", [zeta, v], [rate, zeta.T @ Q @ zeta + v.T @ R_eff @ v])
