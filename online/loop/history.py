"""What a closed-loop run leaves behind, as it grows."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...symbolic import Problem
from ...symbolic.arrays import Array
from ..learning import Look


@dataclass
class History:
    """Lists that grow with the run; `record.to_dataset` names and stacks them.

    Attributes
    ----------
    problem : that was run: what its states and inputs are called
    """

    problem: Problem
    time: list[float] = field(default_factory=list)
    zeta: list[Array] = field(default_factory=list)
    u_control: list[Array] = field(default_factory=list)
    disturbance: list[Array] = field(default_factory=list)
    cost: list[float] = field(default_factory=list)
    attenuated: list[float] = field(default_factory=list)
    learn_time: list[float] = field(default_factory=list)
    bellman_error: list[float] = field(default_factory=list)
    sample_error: list[float] = field(default_factory=list)
    projecting: list[bool] = field(default_factory=list)
    predicted_cost: list[float] = field(default_factory=list)
    accepted: list[float] = field(default_factory=list)
    fallback: list[bool] = field(default_factory=list)
    linear: list[bool] = field(default_factory=list)
    critic: list[Array] = field(default_factory=list)
    actor_1: list[Array] = field(default_factory=list)
    actor_2: list[Array] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    remembered: Array | None = None
    stopped: str | None = None
    wall_seconds: float = 0.0
    processor_seconds: float = 0.0
    policy_seconds: list[float] = field(default_factory=list)

    @property
    def policy_mean(self) -> float:
        """Mean wall time of a policy's step [s]."""
        return sum(self.policy_seconds) / max(len(self.policy_seconds), 1)
