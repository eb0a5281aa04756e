"""One player's optimal control problem, the other player's policy frozen into the plant.

    minimise over w   ∫_0^T L(ζ, w, p) dt + ζ(T)'E ζ(T),   ζ_dot = F(ζ, w, p),  ζ(0) = ζ_0

with parameters p(t) that are given. The single-player equivalent, the disturbance's best response to a
control policy and the control's to a disturbance policy are all of this kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np
from casadi import DM, SX

from ...symbolic import Bound, Kernel, Problem
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from ..path import Domain


@dataclass(frozen=True, eq=False)
class Stage:
    """The problem as expressions.

    Attributes
    ----------
    zeta : (n,) symbol
    w : (k,) symbol, the input of the player that is free
    parameters : (q,) symbol p; empty where nothing varies
    rate : (n,) expression F
    running : scalar expression L
    terminal : (n, n) symmetric E
    domain : bounds outside of which F has no meaning
    """

    zeta: SX
    w: SX
    parameters: SX
    rate: SX
    running: SX
    terminal: Array
    domain: tuple[Bound, ...] = ()

    @cached_property
    def point(self) -> casadi.Function:
        """(ζ, w, p) -> (F, L)."""
        inputs = {"zeta": self.zeta, "w": self.w, "parameters": self.parameters}
        return dense_function("point", inputs, {"rate": self.rate, "running": self.running})

    @cached_property
    def inside(self) -> Domain:
        """The domain for whole trajectories."""
        return Domain(self.zeta, self.domain)

    @cached_property
    def kernel(self) -> Kernel:
        """The same on numpy arrays."""
        return Kernel(self.point)


def single_player(problem: Problem) -> Stage:
    """Return the single-player equivalent: L = ζ'Qζ + v'R_eff v and E = P."""
    zeta, v = problem.zeta, SX.sym("v", problem.n_inputs)
    Q, R_eff = DM(problem.game.Q), DM(problem.game.R_eff)
    return Stage(
        zeta=zeta,
        w=v,
        parameters=SX(0, 1),
        rate=problem.drift + problem.input_matrix @ v,
        running=zeta.T @ Q @ zeta + v.T @ R_eff @ v,
        terminal=problem.P,
        domain=problem.domain,
    )


def against_control(
    problem: Problem, u_control: SX, parameters: SX, terminal: Array, gamma_squared: SX | None = None
) -> Stage:
    """Return the disturbance's problem against a control policy: L = -r of (5), to be minimised.

    Parameters
    ----------
    u_control : (k,) expression of the problem's ζ and `parameters`
    terminal : (n, n) cost after T, which enters as -ζ(T)'E ζ(T)
    gamma_squared : γ^2 as an expression of `parameters`; the game's if None
    """
    game, w = problem.game, SX.sym("u_disturbance", problem.n_inputs)
    level = SX(game.gamma**2) if gamma_squared is None else gamma_squared
    attenuated = level * (w.T @ DM(game.W_d) @ w)
    return Stage(
        zeta=problem.zeta,
        w=w,
        parameters=parameters,
        rate=problem.drift + problem.input_matrix @ (u_control + w),
        running=attenuated - output_cost(problem, u_control),
        terminal=-terminal,
        domain=problem.domain,
    )


def against_disturbance(problem: Problem, u_disturbance: SX, parameters: SX, terminal: Array) -> Stage:
    """Return the control's problem against a disturbance policy: L = r of (5)."""
    game, w = problem.game, SX.sym("u_control", problem.n_inputs)
    attenuated = game.gamma**2 * (u_disturbance.T @ DM(game.W_d) @ u_disturbance)
    return Stage(
        zeta=problem.zeta,
        w=w,
        parameters=parameters,
        rate=problem.drift + problem.input_matrix @ (w + u_disturbance),
        running=output_cost(problem, w) - attenuated,
        terminal=terminal,
        domain=problem.domain,
    )


def against_known(
    zeta: SX, w: SX, t: SX, rate: SX, Q: Array, R: Array, domain: tuple[Bound, ...] = ()
) -> Stage:
    """Return the control's problem where all that disturbs is known: L = ζ'Qζ + w'R w and E = 0.

    Parameters
    ----------
    zeta, w, t : symbols of the state (n,), the control (k,) and the time, the stage's parameter
    rate : (n,) expression of ζ_dot in them
    domain : bounds outside of which it has no meaning
    """
    running = zeta.T @ DM(Q) @ zeta + w.T @ DM(R) @ w
    n = int(zeta.shape[0])
    return Stage(zeta, w, t, rate, running, terminal=np.zeros((n, n)), domain=domain)


def output_cost(problem: Problem, u_control: SX) -> SX:
    """Return |z|^2 = ζ'Qζ + u_1'R u_1 as an expression."""
    zeta, game = problem.zeta, problem.game
    return zeta.T @ DM(game.Q) @ zeta + u_control.T @ DM(game.R) @ u_control
