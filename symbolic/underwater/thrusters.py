"""The thrusters of a vehicle: where they are, what they can give, and what that takes."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import scipy
from pydantic import Field, field_validator

from ..arrays import Array
from ..toml import Settings

AXES = ("X (surge)", "Y (sway)", "Z (heave)", "K (roll)", "M (pitch)", "N (yaw)")
Positive = Annotated[float, Field(gt=0.0, strict=True)]


class Thrusters(Settings):
    """Thruster layout: tau_b = allocation @ thrust.

    Attributes
    ----------
    allocation : 6 rows X Y Z K M N, one column a thruster [-], [m]
    limits : [reverse, forward] thrust of every thruster [N]
    full_power : electrical power of a thruster at either limit [W]; None if it is not known
    """

    allocation: list[list[float]]
    limits: tuple[float, float]
    full_power: Positive | None = None

    @field_validator("allocation")
    @classmethod
    def _rank(cls, rows: list[list[float]]) -> list[list[float]]:
        if len(rows) != 6 or len({len(row) for row in rows}) != 1:
            raise ValueError("the allocation must have 6 rows (X Y Z K M N) of equal length")
        undriven = _undriven(np.array(rows))
        if undriven:
            raise ValueError(
                f"these {len(rows[0])} thrusters can't drive {' and '.join(undriven)} by itself (rank "
                f"{6 - len(undriven)}), but station keeping of six degrees of freedom needs rank 6; "
                "add or turn thrusters, or leave the thrusters out and command wrenches"
            )
        return rows

    @field_validator("limits")
    @classmethod
    def _sign(cls, limits: tuple[float, float]) -> tuple[float, float]:
        if not limits[0] < 0.0 < limits[1]:
            raise ValueError(f"limits are {list(limits)}, but must be [negative, positive] in N")
        return limits

    @property
    def matrix(self) -> Array:
        """Allocation, shape (6, n_thrusters)."""
        return np.array(self.allocation)

    def thrust(self, tau_b: Array) -> Array:
        """Return the least-norm thrusts [N] that give the body wrench; shape (..., n_thrusters)."""
        return tau_b @ np.linalg.pinv(self.matrix).T

    def least_share(self, tau_b: Array) -> float:
        """Return the least s for which thrusts within s times the limits give the body wrench (6,).

        The linear program min s with B T = τ_b and s T_min <= T <= s T_max; above 1 they can't.
        """
        if not np.any(tau_b):
            return 0.0
        matrix, n = self.matrix, len(self.allocation[0])
        reverse, forward = self.limits
        eye, one = np.eye(n), np.ones((n, 1))
        answer = scipy.optimize.linprog(
            np.append(np.zeros(n), 1.0),
            A_ub=np.block([[eye, -forward * one], [-eye, reverse * one]]),
            b_ub=np.zeros(2 * n),
            A_eq=np.column_stack([matrix, np.zeros(6)]),
            b_eq=tau_b,
            bounds=[(None, None)] * n + [(0.0, None)],
        )
        return np.inf if answer.x is None else float(answer.x[-1])

    def power(self, thrust: Array) -> Array | None:
        """Return the electrical power of all thrusters together, shape (...,) [W].

        P (|T| / T_limit)^(3/2) each, with the limit of the direction: momentum theory of a propeller at
        rest (ideal power T^(3/2) / sqrt(2 ρ A)), scaled to the measured power P at the limits.
        """
        if self.full_power is None:
            return None
        reverse, forward = self.limits
        share = np.maximum(thrust / forward, thrust / reverse)
        return np.asarray(self.full_power * np.sum(share**1.5, axis=-1))


def _undriven(allocation: Array) -> list[str]:
    """Return the axes that lack a thruster: for each wrench that none can give its largest share.

    Moments count at arms of the mean length there is, so that they compare with forces.
    """
    arms = np.linalg.norm(allocation[3:], axis=0)
    length = float(arms[arms > 0.0].mean()) if arms.any() else 1.0
    rows = allocation / np.repeat([1.0, length], 3)[:, None]
    wrenches, sizes, _ = np.linalg.svd(rows)
    sizes = np.append(sizes, np.zeros(6 - len(sizes)))
    missing = np.abs(wrenches[:, sizes <= 1e-6])
    found = list[int]()
    for shares in missing.T:
        found.append(max(set(range(6)) - set(found), key=lambda axis: round(float(shares[axis]), 9)))
    return [AXES[axis] for axis in sorted(found)]
