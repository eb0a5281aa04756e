"""The plant of a problem for scipy: independent of the collocation, used to start and to check it."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
from casadi import SX

from ...symbolic import Kernel, Problem
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from ...symbolic.integration import integrate

Policy = Callable[[float, Array], Array]


class Plant:
    """ζ_dot = f + g v and the running cost L = ζ'Qζ + v'R_eff v of a problem."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        v = SX.sym("v", problem.n_inputs)
        rate = problem.drift + problem.input_matrix @ v
        inputs = {"zeta": problem.zeta, "v": v}
        self._rate = Kernel(dense_function("rate", inputs, {"zeta_dot": rate}))
        terms = {"f": problem.drift, "g": casadi.densify(problem.input_matrix)}
        self._terms = Kernel(dense_function("terms", {"zeta": problem.zeta}, terms))
        switching = {"switching": problem.switching}
        self._switching = Kernel(dense_function("switching", {"zeta": problem.zeta}, switching))

    def rate(self, zeta: Array, v: Array) -> Array:
        """Return f(ζ) + g(ζ) v, shape (n,)."""
        return self._rate(zeta, v)[0]

    def terms(self, zeta: Array) -> tuple[Array, Array]:
        """Return f (n,) and g (n, k)."""
        f, g = self._terms(zeta)
        return f, g.reshape(self.problem.n_states, self.problem.n_inputs, order="F")

    def switching(self, zeta: Array) -> Array:
        """Return the switching functions of the problem, shape (s,)."""
        return self._switching(zeta)[0].ravel()

    def linear_policy(self, zeta: Array) -> Array:
        """Return v of the linear H-infinity policy, -R_eff^-1 B'P ζ, shape (k,)."""
        return np.asarray(self.problem.linear_gain @ zeta)

    def simulate(
        self,
        zeta0: Array,
        policy: Policy,
        times: Array,
        *,
        tolerance: float = 1e-10,
        restart: bool = True,
    ) -> tuple[Array, Array]:
        """Integrate states and running cost by scipy's DOP853 with error control.

        With `restart` the integration starts anew at each of `times`, as a policy asks for that is
        smooth only between them.

        Returns
        -------
        states : (len(times), n)
        cost : (len(times),) integral of L from times[0]

        Raises
        ------
        RunError
            If the integration fails or becomes too stiff.
        """
        game, n = self.problem.game, self.problem.n_states

        def rhs(t: float, y: Array) -> Array:
            zeta = y[:n]
            v = policy(t, zeta)
            running = zeta @ game.Q @ zeta + v @ game.R_eff @ v
            return np.append(self.rate(zeta, v), running)

        def advance(y: Array, span: Array) -> Array:
            scale = np.append(self.problem.scale, max(y[-1], 1.0))
            return integrate(rhs, y, span, rtol=tolerance, atol=tolerance * 1e-2 * scale)

        start = np.append(zeta0, 0.0)
        if restart:
            rows = [start]
            for i in range(len(times) - 1):
                rows.append(advance(rows[-1], times[i : i + 2])[-1])
            stacked = np.array(rows)
        else:
            stacked = np.vstack([start, advance(start, times)])
        return stacked[:, :n], stacked[:, n]
