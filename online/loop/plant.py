"""The plant of any problem under held inputs, with its cost beside it."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX

from ...symbolic import Problem, RunError
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from .held import HeldRates


@dataclass(frozen=True)
class PlantState:
    """A plant at one instant.

    Attributes
    ----------
    zeta : (n,) state
    cost : integral of ζ'Qζ + u_1'R u_1 so far
    attenuated : integral of γ^2 d'W_d d so far; the game's cost is the difference
    """

    zeta: Array
    cost: float
    attenuated: float


class ProblemPlant:
    """ζ_dot = f(ζ) + g_1(ζ) u_1 + g_2(ζ) d, both inputs held over a control period."""

    def __init__(self, problem: Problem, tolerance: float = 1e-8, *, compiled: bool = True) -> None:
        size = np.append(1e-2 * problem.scale, [1e-2, 1e-2])
        self._held = HeldRates(held_rates(problem), size, tolerance, compiled=compiled)

    def advance(
        self, t: float, state: PlantState, u_control: Array, disturbance: Array, dt: float
    ) -> PlantState:
        """Integrate over dt [s] with u_1 (k,) and d (k_2,) held, by DOP853.

        Raises
        ------
        RunError
            If an input is not finite, or the integration fails or becomes too stiff.
        """
        if not np.all(np.isfinite(u_control)) or not np.all(np.isfinite(disturbance)):
            raise RunError(f"an input is not finite at t = {t:.2f} s")
        held, n = (u_control, disturbance), len(state.zeta)
        y = np.concatenate((state.zeta, (state.cost, state.attenuated)))
        reached = self._held.one_step(y, dt, *held)
        if reached is None:
            rates = self._held.evaluate
            reached = self._held.integrated(t, t + dt, y, lambda _, at: rates(at[:n], *held)[0])
        return PlantState(reached[:n], float(reached[n]), float(reached[n + 1]))


def held_rates(problem: Problem) -> casadi.Function:
    """Return ζ_dot and the rates of cost and attenuation as a function of zeta, u_1 and d, (n + 2,)."""
    game, zeta = problem.game, problem.zeta
    u, d = SX.sym("u_control", problem.n_inputs), SX.sym("disturbance", len(game.W_d))
    cost = zeta.T @ DM(game.Q) @ zeta + u.T @ DM(game.R) @ u
    attenuated = game.gamma**2 * d.T @ DM(game.W_d) @ d if np.isfinite(game.gamma) else SX(0)
    zeta_dot = problem.drift + problem.control_matrix @ u + problem.disturbance_matrix @ d
    rates = casadi.vertcat(zeta_dot, cost, attenuated)
    return dense_function(
        "held_problem", {"zeta": zeta, "u_control": u, "disturbance": d}, {"rates": rates}
    )
