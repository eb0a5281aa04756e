"""What a vehicle's closed-loop run leaves behind."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...symbolic.arrays import Array
from ..loop import History


@dataclass
class VehicleHistory(History):
    """The lists of a run, and those that only a vehicle has.

    Attributes
    ----------
    tau_b : (6,) wrench that the vehicle got [N, N m]
    thrust : (n_thrusters,) [N], with thruster limits
    saturated : whether the least-norm thrusts exceeded a limit
    estimate : (6,) what the disturbance observer says, with an observer [N, N m]
    """

    tau_b: list[Array] = field(default_factory=list)
    thrust: list[Array] = field(default_factory=list)
    saturated: list[bool] = field(default_factory=list)
    estimate: list[Array] = field(default_factory=list)
