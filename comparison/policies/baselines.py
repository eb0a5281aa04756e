"""Linear policies that the learned one is compared with, and how any policy drives a vehicle."""

from __future__ import annotations

import numpy as np

from ...online import Policy
from ...online.loop import Feedback, MeanState
from ...symbolic import Game, Problem, StationKeeping
from ...symbolic.arrays import Array
from ...symbolic.game import AngleTracker


class LinearPolicy(Feedback):
    """The linear H-infinity policy of the game Riccati solution: nothing is learned.

    u_1 = -R^-1 B'P ζ and u_2 = γ^-2 W_d^-1 B'P ζ with constant gains; for a vehicle in the earth frame.

    Attributes
    ----------
    gain : (k, n) K of u_1 = -K ζ
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.gain = self._gain()
        self._mean_state = MeanState(problem)

    def control(self, zeta: Array, dt: float) -> Array:
        """Return -K ζ, where the loop is fast at the mean state of the period."""
        return -self.gain @ self._mean_state(zeta, dt)

    def _gain(self) -> Array:
        return self.problem.linear_gains[0]


class LQR(LinearPolicy):
    """The linear-quadratic regulator: the Riccati equation with R, as if nothing disturbed (γ = ∞)."""

    def _gain(self) -> Array:
        game = self.problem.game
        alone = self.problem.with_game(Game(game.Q, game.R, game.W_d, np.inf))
        return alone.linear_gains[0]


class OnVehicle:
    """A policy u_1(ζ) as what drives a vehicle: the trim is added, and forces go into the body frame.

    Attributes
    ----------
    policy : that is asked
    station : vehicle and game
    zeta : (12,) the last state, its attitude as it continues the one before (`AngleTracker`)
    """

    def __init__(self, policy: Policy, station: StationKeeping) -> None:
        self.policy, self.station = policy, station
        self.zeta = np.zeros(12)
        self._angles = AngleTracker(station.problem.angles)

    @property
    def u_control(self) -> Array:
        """The policy's u_1 at the last state, without trim, (6,) [N, N m]."""
        return self.policy.u_control

    @property
    def u_disturbance(self) -> Array:
        """The policy's u_2 at the last state, (6,) [N, N m]."""
        return self.policy.u_disturbance

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        """Return the body wrench J'(u_1 + u_trim) to hold for dt, shape (6,)."""
        self.zeta = self._angles.enter(np.concatenate([eta, eta_dot]))
        return self.body_wrench(self.policy.step(self.zeta, dt) + self.station.model.u_trim)

    def body_wrench(self, u: Array) -> Array:
        """Return J(η)'u at the last state, shape (6,)."""
        (J,) = self.station.model.kinematics(self.zeta[:6])
        return np.asarray(J.T @ u)
