"""Policies that the learned one is compared with; each has the steps of a controller."""

from __future__ import annotations

import numpy as np

from ..symbolic import StationKeeping
from ..symbolic.vehicle import Array


class LinearPolicy:
    """The linear H-infinity policy of the game Riccati solution: nothing is learned.

    u_1 = -R^-1 B'P ζ and u_2 = γ^-2 W_d^-1 B'P ζ with constant gains in the earth frame.

    Attributes
    ----------
    zeta, u_control, u_disturbance : at the last step
    """

    def __init__(self, station: StationKeeping) -> None:
        self.station = station
        _, B = station.problem.linearization
        gain = B.T @ station.problem.P
        self._control = -station.game.R_inverse @ gain
        self._disturbance = station.game.disturbance_inverse @ gain
        self.zeta = np.zeros(12)
        self.u_control = np.zeros(6)
        self.u_disturbance = np.zeros(6)

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        """Return the body wrench J'(u_1 + u_trim) to hold for dt, shape (6,)."""
        self.zeta = np.concatenate([eta, eta_dot])
        self.u_control = self._control @ self.zeta
        self.u_disturbance = self._disturbance @ self.zeta
        return self.body_wrench(self.u_control + self.station.model.u_trim)

    def body_wrench(self, u: Array) -> Array:
        """Return J(η)'u at the last state, shape (6,)."""
        (J,) = self.station.model.kinematics(self.zeta[:6])
        return np.asarray(J.T @ u)
