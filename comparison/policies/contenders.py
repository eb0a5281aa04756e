"""The policies that are compared, by name: what each is called, and how a run of it is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ...online import AS_PRINTED, Controller, Policy
from ...symbolic import InputError
from ...symbolic.errors import nearest
from ..scenario import Scenario
from .baselines import LQR, LinearPolicy
from .mpc import ModelPredictive
from .pid import CascadedPID

# what the paper's plain choices make of a scenario
_QUADRATIC: dict[str, dict[str, Any]] = {
    "basis": {"name": "quadratic"},
    "learner": {"weights": "riccati"},
}


@dataclass(frozen=True)
class Contender:
    """A policy that takes part in a comparison.

    Attributes
    ----------
    label : what figures and tables call it
    make : makes the policy of a scenario that `changed` was applied to
    changes : settings by group that differ from the scenario's
    """

    label: str
    make: Callable[[Scenario], Policy] = Controller
    changes: Mapping[str, dict[str, Any]] = field(default_factory=dict)

    def changed(self, scenario: Scenario) -> Scenario:
        """Return the scenario that its run has."""
        return scenario.with_settings(**self.changes)


CONTENDERS: dict[str, Contender] = {
    "learned": Contender("learned"),
    "linear": Contender("linear H-infinity", lambda scenario: LinearPolicy(scenario.station_keeping())),
    "lqr": Contender("LQR", lambda scenario: LQR(scenario.station_keeping())),
    "pid": Contender("cascaded PID", lambda scenario: CascadedPID(scenario.station_keeping())),
    "mpc": Contender(
        "nonlinear MPC, 3 s", lambda scenario: ModelPredictive(scenario.station_keeping())
    ),
    "quadratic": Contender("learned, quadratic basis", changes=_QUADRATIC),
    "gradient": Contender("gradient law as printed", changes={"learner": AS_PRINTED}),
}


def contender(name: str) -> Contender:
    """Return a contender by name.

    Raises
    ------
    InputError
        If there is none of that name; the nearest one is given.
    """
    if name not in CONTENDERS:
        raise InputError(f"there is no policy '{name}': {nearest(name, CONTENDERS)}")
    return CONTENDERS[name]
