"""Policies that the learned one is compared with; each has the steps of a controller.

None of them but the learner has a disturbance player of its own. In `game` mode the disturbance
answers every control as it does at the saddle point,

    u_2 = -γ^-2 W_d^-1 R u_1,   so that   v = u_1 + u_2 = R_eff^-1 R u_1   and
    u_1'R u_1 - γ^2 u_2'W_d u_2 = v'R_eff v:

the cost of the run is that of the single-player equivalent under v, V* is the least there is, and the
regret is nonnegative and zero for the optimal u_1 alone. Against the worst disturbance the policy
costs at least as much, so that the regret is a lower bound of what it loses in the game. For the
linear H-infinity policy and for `ModelPredictive` this u_2 is their own. `LQR` and `CascadedPID` were
designed for a plant on which nobody answers; they get R_eff^-1 R of the force they ask for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ...symbolic import Game, StationKeeping
from ...symbolic.arrays import Array


class Baseline(ABC):
    """A control law u_1(ζ) and what the loop asks of a policy.

    Attributes
    ----------
    station : vehicle and game
    zeta : (12,) the last state, yaw within ±π
    u_control, u_disturbance : (6,) u_1 without trim and the answer u_2 there [N, N m]
    """

    def __init__(self, station: StationKeeping) -> None:
        self.station = station
        game = station.game
        self._answer = -game.disturbance_inverse @ game.R
        self.zeta = np.zeros(12)
        self.u_control = np.zeros(6)
        self.u_disturbance = np.zeros(6)

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        """Return the body wrench J'(u_1 + u_trim) to hold for dt, shape (6,)."""
        self.zeta = np.concatenate([eta, eta_dot])
        self.zeta[5] -= 2.0 * np.pi * np.round(self.zeta[5] / (2.0 * np.pi))
        self.u_control = self.control(self.zeta, dt)
        self.u_disturbance = self._answer @ self.u_control
        return self.body_wrench(self.u_control + self.station.model.u_trim)

    def body_wrench(self, u: Array) -> Array:
        """Return J(η)'u at the last state, shape (6,)."""
        (J,) = self.station.model.kinematics(self.zeta[:6])
        return np.asarray(J.T @ u)

    @abstractmethod
    def control(self, zeta: Array, dt: float) -> Array:
        """Return u_1 at ζ, shape (6,) [N, N m] in the earth frame, to be held for dt [s]."""


class LinearPolicy(Baseline):
    """The linear H-infinity policy of the game Riccati solution: nothing is learned.

    u_1 = -R^-1 B'P ζ and u_2 = γ^-2 W_d^-1 B'P ζ with constant gains in the earth frame.

    Attributes
    ----------
    gain : (6, 12) K of u_1 = -K ζ
    """

    def __init__(self, station: StationKeeping) -> None:
        super().__init__(station)
        self.gain = self._gain()

    def control(self, zeta: Array, dt: float) -> Array:
        """Return -K ζ."""
        return -self.gain @ zeta

    def _gain(self) -> Array:
        return self.station.problem.linear_gains[0]


class LQR(LinearPolicy):
    """The linear-quadratic regulator: the Riccati equation with R, as if nothing disturbed (γ = ∞)."""

    def _gain(self) -> Array:
        game = self.station.game
        alone = self.station.problem.with_game(Game(game.Q, game.R, game.W_d, np.inf))
        return alone.linear_gains[0]
