"""A control policy u_1 = π(ζ) on the plant of a game, and the L2 gain of its linearised closed loop.

With |z|^2 = ζ'Qζ + u_1'R u_1 and |d|^2 = d'W_d d the closed loop has L2 gain g or less if, from rest,

    ∫_0^T |z|^2 dt <= g^2 ∫_0^T |d|^2 dt     for every d and T

(van der Schaft 2017, ch. 8). For the linearised closed loop A_K = A - B K, K = -∂π/∂ζ at 0, the gain is
the H-infinity norm: the infimum of g for which A_K is stable and the bounded-real Riccati equation

    A_K'X + X A_K + Q + K'R K + g^-2 X B W_d^-1 B'X = 0

has a stabilising solution X >= 0 (Basar and Bernhard 1995, ch. 4; Zhou, Doyle and Glover 1996, ch. 13).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np
from casadi import DM, SX

from ...symbolic import Basis, InputError, Problem
from ...symbolic.arrays import Array
from ...symbolic.game import stabilising_solution


def linear_policy(problem: Problem) -> SX:
    """Return the linear H-infinity control policy -R^-1 B'P ζ, constant gains, shape (k,)."""
    _, B = problem.linearization
    return DM(-problem.game.R_inverse @ B.T @ problem.P) @ problem.zeta


def learned_policy(problem: Problem, basis: Basis, weights: Array | SX) -> SX:
    """Return û_1 of (14), -1/2 R^-1 g'σ'Ŵ, for weights or a symbol of them (m,), shape (k,)."""
    value = casadi.dot(SX(weights), basis.sigma)
    push = problem.input_matrix.T @ casadi.gradient(value, problem.zeta)
    return -0.5 * DM(problem.game.R_inverse) @ push


@dataclass(frozen=True, eq=False)
class ControlPolicy:
    """A control policy u_1 = π(ζ) on the plant of a game.

    Attributes
    ----------
    problem : the game on its plant
    u_control : (k,) expression of the problem's ζ

    Raises
    ------
    InputError
        If it has the wrong shape, contains other symbols, or π(0) is not zero.
    """

    problem: Problem
    u_control: SX

    def __post_init__(self) -> None:
        k = self.problem.n_inputs
        if self.u_control.shape != (k, 1):
            raise InputError(f"a control policy must be a column of {k} expressions of the state")
        try:
            rest = self._at_rest(self.u_control)
        except RuntimeError:
            raise InputError(
                "a control policy must be an expression of the problem's own state symbol, and of "
                "no other symbol"
            ) from None
        if not np.abs(rest).max() < 1e-9:
            raise InputError("a control policy must be zero at the station, or the cost is infinite")

    @cached_property
    def closed_loop(self) -> Array:
        """A - B K, shape (n, n)."""
        A, B = self.problem.linearization
        return np.asarray(A - B @ self.gain)

    @cached_property
    def gain(self) -> Array:
        """K = -∂π/∂ζ at the station, shape (k, n)."""
        return -self._at_rest(casadi.jacobian(self.u_control, self.problem.zeta))

    @cached_property
    def stable(self) -> bool:
        """Whether the linearised closed loop is asymptotically stable."""
        return bool(np.linalg.eigvals(self.closed_loop).real.max() < 0.0)

    @cached_property
    def l2_gain(self) -> float:
        """L2 gain of the linearised closed loop [-], infinite if it is not stable; by bisection."""
        if not self.stable:
            return np.inf
        upper = 1.0
        while self.bounded_real(upper) is None:
            upper *= 2.0
            if upper > 1e12:
                return np.inf
        lower = 0.0
        while upper - lower > 1e-10 * upper:
            middle = 0.5 * (lower + upper)
            if self.bounded_real(middle) is None:
                lower = middle
            else:
                upper = middle
        return upper

    def frequency_response(self, omega: float) -> Array:
        """Return the transfer matrix from W_d^(1/2) d to (Q^(1/2) ζ, R^(1/2) u_1) at ω [rad/s].

        Shape (n + k, k), with Cholesky factors as the square roots.
        """
        game, (_, B) = self.problem.game, self.problem.linearization
        n = self.problem.n_states
        states = np.linalg.solve(1j * omega * np.eye(n) - self.closed_loop, B)
        output = np.vstack([np.linalg.cholesky(game.Q).T, -np.linalg.cholesky(game.R).T @ self.gain])
        return np.asarray(output @ states @ np.linalg.inv(np.linalg.cholesky(game.W_d).T))

    def worst_harmonic(self) -> tuple[float, Array]:
        """Return about the frequency ω [rad/s] with the largest singular value, and d (k,) there.

        The disturbance is the real part of d e^(jωt). A grid of 400 frequencies, and zero.
        """
        grid = np.append(0.0, np.geomspace(1e-3, 1e2, 400))
        peaks = [np.linalg.svd(self.frequency_response(w), compute_uv=False)[0] for w in grid]
        omega = float(grid[int(np.argmax(peaks))])
        _, _, rows = np.linalg.svd(self.frequency_response(omega))
        W_root = np.linalg.cholesky(self.problem.game.W_d).T
        return omega, np.asarray(np.linalg.solve(W_root, rows[0].conj()))

    def bounded_real(self, gamma: float) -> Array | None:
        """Return X of the bounded-real Riccati equation at a level γ, or None where there is none.

        ζ'X ζ is the worst case of ∫ |z|^2 - γ^2 |d|^2 over d in the linearised closed loop.
        """
        game, (_, B) = self.problem.game, self.problem.linearization
        if not self.stable:
            return None
        output = game.Q + self.gain.T @ game.R @ self.gain
        level = np.asarray(-np.linalg.inv(game.W_d) / float(gamma) ** 2, dtype=np.float64)
        return stabilising_solution(self.closed_loop, B, output, level)

    def excludes(self, gamma: float) -> str | None:
        """Return why the linearised closed loop does not attain the level γ, or None if it does."""
        if not self.stable:
            return "the linearised closed loop is not stable"
        if self.bounded_real(gamma) is None:
            return (
                f"the linearised closed loop has an L2 gain of {self.l2_gain:.4g}, which is not below "
                f"gamma = {gamma:g}"
            )
        return None

    def _at_rest(self, expression: SX) -> Array:
        zeta = self.problem.zeta
        value = casadi.Function("at_rest", [zeta], [expression])(np.zeros(zeta.shape[0]))
        return np.array(DM(value).full(), dtype=float)
