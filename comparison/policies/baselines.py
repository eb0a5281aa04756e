"""Linear policies that the learned one is compared with, and how any policy drives a vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...online import Policy
from ...online.loop import Feedback, MeanState
from ...online.vehicle import Flags, Limits, MeasurementGate, require_dt, require_measurement
from ...symbolic import Game, Problem, RunError, StationKeeping
from ...symbolic.arrays import Array


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

    Measurements are refused, limited and flagged by the rules of a `Controller`.

    Parameters
    ----------
    policy : that is asked
    station : vehicle and game
    limits : where measurements are flagged; those of vehicle and game if None

    Attributes
    ----------
    policy, station, limits : as given
    zeta : (12,) the last state, its attitude as it continues the one before (`AngleTracker`)
    flags : of the last step
    """

    def __init__(self, policy: Policy, station: StationKeeping, limits: Limits | None = None) -> None:
        self.policy, self.station = policy, station
        self.limits = Limits.of(station) if limits is None else limits
        self.zeta = np.zeros(12)
        self.flags: Flags = ()
        self._gate = MeasurementGate(station, self.limits)

    @property
    def u_control(self) -> Array:
        """The policy's u_1 at the last state, without trim, (6,) [N, N m]."""
        return self.policy.u_control

    @property
    def u_disturbance(self) -> Array:
        """The policy's u_2 at the last state, (6,) [N, N m]."""
        return self.policy.u_disturbance

    def step(self, eta: ArrayLike, eta_dot: ArrayLike, dt: float) -> Array:
        """Return the body wrench J'(u_1 + u_trim) to hold for dt, shape (6,).

        Raises
        ------
        InputError
            For what can't be a measurement, as `Controller.step`; nothing changes.
        RunError
            If the policy's wrench is not finite.
        """
        measured, dt = require_measurement(eta, eta_dot), require_dt(dt)
        seen = self._gate.look(measured, dt)
        u_control = self.policy.step(seen.policy, seen.dt)
        (J,) = self.station.model.kinematics(seen.zeta[:6])
        tau_b = np.asarray(J.T @ (u_control + self.station.model.u_trim))
        if not np.isfinite(tau_b).all():
            raise RunError("the policy asks for a wrench that is not finite")
        self._gate.keep(seen)
        self.zeta, self.flags = seen.zeta, seen.flags
        return tau_b

    def body_wrench(self, u: Array) -> Array:
        """Return J(η)'u at the last state, shape (6,)."""
        (J,) = self.station.model.kinematics(self.zeta[:6])
        return np.asarray(J.T @ u)
