"""The policies that are compared, by name: what each is called, and how a run of it is made."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from ...online import AS_PRINTED, Controller, LearnedPolicy, Policy, VehiclePolicy
from ...online.vehicle import Limits
from ...symbolic import InputError, Setup, StationKeeping
from ...symbolic.errors import nearest
from ...symbolic.pyfile import is_named
from ..scenario import Scenario
from .baselines import LQR, LinearPolicy, OnVehicle
from .mpc import ModelPredictive
from .own import law_of
from .pid import CascadedPID

# what the paper's plain choices make of a scenario
_QUADRATIC: dict[str, dict[str, Any]] = {
    "basis": {"name": "quadratic"},
    "learner": {"weights": "riccati"},
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
        law, run = self.law(setup), scenario.simulation
        if vehicle is None:
            return law
        return OnVehicle(law, vehicle, Limits.of(vehicle, run.chi, run.pitch_limit))


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
    "gradient": Contender("gradient law as printed", changes={"learner": AS_PRINTED}),
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
        return Contender(label_of(name), law_of(name))
    if name not in CONTENDERS:
        raise InputError(
            f"there is no policy '{name}': {nearest(name, CONTENDERS)} (or give file.py:function)"
        )
    return CONTENDERS[name]


def label_of(name: str) -> str:
    """Return what figures and tables call a contender; one's own is called as its function or its file.

    The file's name where the function is called `make`.
    """
    if not is_named(name):
        return CONTENDERS[name].label
    file, _, function = name.rpartition(":")
    return PurePath(file).stem if function == "make" else function


def require_own(names: Iterable[str], setup: Setup) -> None:
    """Raise InputError unless these are policies of one's own that can be made and told apart."""
    labels = [one.label for one in CONTENDERS.values()]
    for name in names:
        if not is_named(name):
            raise InputError(
                f"'{name}' is no policy of your own, and the shipped ones take part anyway; give "
                "file.py:function"
            )
        law = contender(name).law
        assert law is not None
        law(setup)
        if label_of(name) in labels:
            raise InputError(
                f"two policies are called '{label_of(name)}'; rename '{name}', its file or its function"
            )
        labels.append(label_of(name))
