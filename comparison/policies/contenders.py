"""The policies that are compared, by name: what each is called, and how a run of it is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ...online import Controller, FunctionPolicy, LearnedPolicy, Policy, VehiclePolicy
from ...symbolic import InputError, Setup, StationKeeping
from ...symbolic.errors import nearest
from ...symbolic.pyfile import find_callable, is_named
from ..scenario import Scenario, named_in
from .baselines import LQR, LinearPolicy, OnVehicle
from .mpc import ModelPredictive
from .pid import CascadedPID

# what the paper's plain choices make of a scenario
_QUADRATIC: dict[str, dict[str, Any]] = {
    "basis": {"name": "quadratic"},
    "learner": {"weights": "riccati"},
}
_GRADIENT: dict[str, dict[str, Any]] = {
    "learner": {
        "rule": "gradient",
        "error": "bellman",
        "safeguard": False,
        "normalizer": "paper",
        "leash": 0.0,
        "gain_samples": None,
        "average_samples": False,
        "gain_actor_1": 2.0,
        "gain_actor_2": 2.0,
    },
    "samples": {"strategy": "fixed"},
}


AnyPolicy = Policy | VehiclePolicy


@dataclass(frozen=True)
class Contender:
    """A policy that takes part in a comparison.

    Attributes
    ----------
    label : what figures and tables call it
    law : makes the control law u_1(ζ) of a setup; None for the learner
    changes : settings by group that differ from the scenario's
    suits : whether there is such a policy for a setup
    """

    label: str
    law: Callable[[Setup], Policy] | None = None
    changes: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    suits: Callable[[Setup], bool] = lambda setup: True

    def changed(self, scenario: Scenario) -> Scenario:
        """Return the scenario that its run has."""
        return scenario.with_settings(**self.changes)

    def make(self, scenario: Scenario) -> AnyPolicy:
        """Return the policy of a scenario that `changed` was applied to."""
        setup = scenario.setup()
        vehicle = setup if isinstance(setup, StationKeeping) else None
        if self.law is None:
            return LearnedPolicy(scenario) if vehicle is None else Controller(scenario)
        law = self.law(setup)
        return law if vehicle is None else OnVehicle(law, vehicle)


def _pid(setup: Setup) -> Policy:
    assert isinstance(setup, StationKeeping)
    return CascadedPID(setup)


CONTENDERS: dict[str, Contender] = {
    "learned": Contender("learned"),
    "linear": Contender("linear H-infinity", lambda setup: LinearPolicy(setup.problem)),
    "lqr": Contender("LQR", lambda setup: LQR(setup.problem)),
    "pid": Contender("cascaded PID", _pid, suits=lambda setup: isinstance(setup, StationKeeping)),
    "mpc": Contender(
        "nonlinear MPC, 3 s",
        lambda setup: ModelPredictive(setup.problem, compiled=setup.compiled),
        suits=lambda setup: setup.problem.inverse_dynamics is not None,
    ),
    "quadratic": Contender("learned, quadratic basis", changes=_QUADRATIC),
    "gradient": Contender("gradient law as printed", changes=_GRADIENT),
}


def available(setup: Setup) -> dict[str, Contender]:
    """Return the contenders that there are for a setup, by name."""
    return {name: one for name, one in CONTENDERS.items() if one.suits(setup)}


def contender(name: str) -> Contender:
    """Return a contender by name, or one's own by "file.py:make".

    `make(setup)` returns a control law: a function u_1(ζ), or an object with the steps of a `Policy`.

    Raises
    ------
    InputError
        If there is none of that name; the nearest one is given. Or if the file can't be loaded.
    """
    if is_named(name):
        return Contender(name.rpartition(":")[2], _from_file(name))
    if name not in CONTENDERS:
        raise InputError(
            f"there is no policy '{name}': {nearest(name, CONTENDERS)} (or give file.py:function)"
        )
    return CONTENDERS[name]


def _from_file(name: str) -> Callable[[Setup], Policy]:
    make = find_callable(named_in(None, name), "the policy")

    def law(setup: Setup) -> Policy:
        made = make(setup)
        if hasattr(made, "step") and hasattr(made, "u_disturbance"):
            return made  # type: ignore[no-any-return]
        if not callable(made):
            raise InputError(
                f"'{name}' returns a {type(made).__name__}, but must return a function of the state, "
                "or an object with step(zeta, dt) and u_disturbance"
            )
        return FunctionPolicy(setup.problem, made)

    return law
