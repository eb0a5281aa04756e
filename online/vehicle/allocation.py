"""Thrust allocation within the limits: least norm where that suffices, else constrained least squares.

    minimise over T   |S (B T - τ)|^2 + ε |T / T_max|^2   subject to   T_min <= T <= T_max

S divides each axis of the wrench by the most that the thrusters give on it alone, so that forces and
moments are errors of like size; ε only chooses among the thrusts that give the same wrench.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from ...symbolic import InputError, RunError, StationKeeping, Vehicle
from ...symbolic.arrays import Array

RIDGE = 1e-8  # ε


@dataclass(frozen=True)
class Allocation:
    """What the thrusters make of a wrench.

    Attributes
    ----------
    thrust : (n_thrusters,) [N]
    wrench : (6,) B T, what the vehicle gets [N, N m]
    saturated : whether the least-norm thrusts exceeded a limit
    """

    thrust: Array
    wrench: Array
    saturated: bool


def trim_share(station: StationKeeping) -> float | None:
    """Return the least share of the thrusters' limits that holds the trim; None without thrusters."""
    thrusters = station.model.vehicle.thrusters
    return None if thrusters is None else thrusters.least_share(station.model.u_trim)


def shown_trim(station: StationKeeping) -> str:
    """Return the trim in words, to a tenth."""
    return f"[{', '.join(f'{x:g}' for x in np.round(station.model.u_trim, 1) + 0.0)}] N, N m"


def require_trim(station: StationKeeping) -> None:
    """Raise InputError where the thrusters can't hold the vehicle at its station."""
    share = trim_share(station)
    if share is not None and share >= 1.0:
        raise InputError(
            f"vehicle '{station.model.vehicle.name}' needs a steady {shown_trim(station)} at its "
            f"station, {share:.2g} times what its thrusters can give; correct weight, buoyancy, their "
            "centres or the current"
        )


class Allocator:
    """The thrusters of a vehicle.

    Attributes
    ----------
    matrix : (6, n_thrusters) B
    scale : (6,) diagonal of S [1/N, 1/(N m)]

    Raises
    ------
    InputError
        If the vehicle has no thruster layout.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        thrusters = vehicle.thrusters
        if thrusters is None:
            raise InputError(
                f"simulation.thruster_limits is on, but vehicle '{vehicle.name}' has no thruster "
                "layout; add [thrusters] to its file or switch the limits off"
            )
        self.matrix = thrusters.matrix
        self._low, self._high = thrusters.limits
        self._inverse = np.linalg.pinv(self.matrix)
        largest = max(-self._low, self._high)
        self.scale = 1.0 / (largest * np.abs(self.matrix).sum(axis=1))
        ridge = np.sqrt(RIDGE) / largest * np.eye(self.matrix.shape[1])
        self._rows = np.vstack([self.scale[:, None] * self.matrix, ridge])

    def allocate(self, tau_b: Array) -> Allocation:
        """Return thrusts within the limits whose wrench is nearest to `tau_b` (6,).

        Raises
        ------
        RunError
            If the wrench is not finite or the constrained problem is not solved.
        """
        if not np.all(np.isfinite(tau_b)):
            raise RunError("the wrench that the thrusters are asked for is not finite")
        thrust = self._inverse @ tau_b
        if thrust.min() >= self._low and thrust.max() <= self._high:
            return Allocation(thrust, np.asarray(tau_b), saturated=False)
        wanted = np.concatenate([self.scale * tau_b, np.zeros(len(thrust))])
        bounds = (self._low, self._high)
        found = lsq_linear(self._rows, wanted, bounds, method="bvls", tol=1e-14, max_iter=200)
        if not found.success:
            raise RunError(f"the thrust allocation failed: {found.message}")
        return Allocation(found.x, self.matrix @ found.x, saturated=True)
