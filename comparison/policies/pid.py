"""The cascade that autopilots use: position error to velocity set-point, velocity error to wrench."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...online.loop import Feedback
from ...symbolic import StationKeeping
from ...symbolic.arrays import Array


@dataclass(frozen=True)
class CascadeSettings:
    """Bandwidths and limits of the cascade; all gains follow from them and the inertia.

    With velocity gain k_p = ω_v M_ii, integral gain ω_i k_p and ω_o the outer gain, an axis has the
    loop transfer function ω_v (s + ω_i)(s + ω_o) / s^3 where drag is left out. ω_v = 4 ω_o and
    ω_i = ω_o / 4 cross over at 1.03 ω_v with a phase margin of 73 degrees; drag adds to it.

    The two outer bandwidths cost least among 0.2 to 0.5 and 0.5 to 1.5 rad/s on the shipped scenario
    from its own start. Their stiffness ω_v ω_o M is about the linear H-infinity policy's, 5 N/m in
    surge. Higher ones hold a current better and pay more for the way home.

    Attributes
    ----------
    position, attitude : outer bandwidth ω_o [rad/s]
    ratio : ω_v / ω_o of the inner loop
    integral : ω_i / ω_o
    speed, rate : limits of the set-points [m/s], [rad/s]
    """

    position: float = 0.25
    attitude: float = 1.5
    ratio: float = 4.0
    integral: float = 0.25
    speed: float = 0.5
    rate: float = 0.5


class CascadedPID(Feedback):
    """P on pose, PI on body velocity, feed-forward of the trim.

        ν_set = clip(-ω_o J^-1 (p, φ, θ, ψ)),   τ = k_p (ν_set - ν) + z,   z_dot = k_i (ν_set - ν)

    (p, φ, θ, ψ) is the pose error; `OnVehicle` adds the trim that balances weight and buoyancy.
    There is no D: the acceleration is not measured. An axis does not integrate while it asks for more
    than the thrusters can give it, in the direction in which it does (anti-windup).

    Attributes
    ----------
    settings : bandwidths and limits
    outer : (6,) ω_o [1/s]
    proportional : (6,) k_p [N/(m/s), N m/(rad/s)]
    integral : (6,) k_i [N/m, N m/rad]
    limits : (2, 6) least and largest wrench of each axis, infinite without a thruster layout
    """

    def __init__(self, station: StationKeeping, settings: CascadeSettings | None = None) -> None:
        super().__init__(station.problem)
        self.station = station
        self.settings = CascadeSettings() if settings is None else settings
        s, vehicle = self.settings, station.model.vehicle
        self.outer = np.repeat([s.position, s.attitude], 3)
        self.proportional = s.ratio * self.outer * np.diag(vehicle.M)
        self.integral = s.integral * self.outer * self.proportional
        self._largest = np.repeat([s.speed, s.rate], 3)
        self.limits = np.array([np.full(6, -np.inf), np.full(6, np.inf)])
        if vehicle.thrusters is not None:
            ends = vehicle.thrusters.matrix[..., None] * np.array(vehicle.thrusters.limits)
            self.limits = np.array([ends.min(axis=2).sum(axis=1), ends.max(axis=2).sum(axis=1)])
        self._stored = np.zeros(6)

    def control(self, zeta: Array, dt: float) -> Array:
        """Return J^-T τ of the cascade, and integrate over dt."""
        (J,) = self.station.model.kinematics(zeta[:6])
        to_body = np.linalg.inv(J)
        wanted = np.clip(-to_body @ (self.outer * zeta[:6]), -self._largest, self._largest)
        error = wanted - to_body @ zeta[6:]
        wrench = self.proportional * error + self._stored
        low, high = self.limits
        windup = ((wrench > high) & (error > 0.0)) | ((wrench < low) & (error < 0.0))
        self._stored = self._stored + np.where(windup, 0.0, self.integral * error * dt)
        return np.asarray(to_body.T @ wrench)
