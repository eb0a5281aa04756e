"""Where the solvers start: the plant under the linear H-infinity policy, by fixed Runge-Kutta steps."""

from __future__ import annotations

from functools import cached_property

import casadi
import numpy as np
from casadi import DM, SX

from ...symbolic import Problem
from ...symbolic.arrays import Array
from ...symbolic.compiled import BatchKernel, dense_function
from ...symbolic.integration import runge_kutta_step

MARGIN_LEFT = 0.2  # of a bound of the domain, of its margin at rest: 80 degrees of pitch


class LinearStart:
    """Trajectories of ζ_dot = f + g v with v = -R_eff^-1 B'P ζ.

    Steps are short enough for the fastest mode of the linearised closed loop, drag included; their
    error does not matter for a start.
    """

    def __init__(self, problem: Problem, *, compiled: bool = True) -> None:
        self.problem = problem
        self._compiled = compiled
        self.longest_step = 0.6 / problem.fastest_rate

    def sample(self, zeta0: Array, times: Array) -> tuple[Array, Array, Array]:
        """Return states (N, n), v (N, k) and ζ_dot (N, n) at ascending times > 0.

        Beyond a failure, and near the edge of the domain, the state decays to rest.
        """
        ends = np.append(0.0, times)
        spans = np.diff(ends)
        counts = np.maximum(np.ceil(spans / self.longest_step), 1).astype(int)
        steps = np.repeat(spans / counts, counts)
        path = self._step.roll(zeta0, steps[:, None])[np.cumsum(counts)]
        lost = ~np.isfinite(path).all(axis=1) | (np.abs(path) > 20.0 * self._size(zeta0)).any(axis=1)
        if self.problem.domain:
            (left,) = self._margins(np.nan_to_num(path))
            lost |= (left < MARGIN_LEFT * self._margins_at_rest).any(axis=1)
        if lost.any():
            first = int(np.argmax(lost))
            path[first:] = zeta0 * np.exp(-times[first:, None])
        v = path @ self.problem.linear_gain.T
        (rate,) = self._rate(path)
        return path, v, rate

    def _size(self, zeta0: Array) -> Array:
        return np.maximum(np.abs(zeta0), self.problem.scale)

    @cached_property
    def _margins(self) -> BatchKernel:
        problem = self.problem
        function = dense_function("margins", {"zeta": problem.zeta}, {"margins": problem.margins})
        return BatchKernel(function, compiled=self._compiled)

    @cached_property
    def _margins_at_rest(self) -> Array:
        return self._margins(np.zeros((1, self.problem.n_states)))[0]

    @cached_property
    def _rate(self) -> BatchKernel:
        zeta, rate = self.problem.zeta, self._closed_loop()
        function = dense_function("linear_rate", {"zeta": zeta}, {"zeta_dot": rate(zeta)})
        return BatchKernel(function, compiled=self._compiled)

    @cached_property
    def _step(self) -> BatchKernel:
        """One classical Runge-Kutta step of length h."""
        zeta, h, rate = self.problem.zeta, SX.sym("h"), self._closed_loop()
        after = runge_kutta_step(rate, zeta, h)
        function = dense_function("linear_step", {"zeta": zeta, "h": h}, {"after": after})
        return BatchKernel(function, compiled=self._compiled)

    def _closed_loop(self) -> casadi.Function:
        problem = self.problem
        v = DM(problem.linear_gain) @ problem.zeta
        return casadi.Function(
            "closed_loop", [problem.zeta], [problem.drift + problem.input_matrix @ v]
        )
