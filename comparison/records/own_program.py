"""Runs of a policy or a critic law of the user's own: a program, which a record names but never runs.

It is run where the user names its file and the hash of that is the record's; else the inputs that it
gave are played back to the plant.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from ...online import to_dataset
from ...online.loop import Progress
from ...symbolic import InputError, Problem, StationKeeping
from ...symbolic.arrays import Array
from ...symbolic.pyfile import file_content, is_named
from ..policies import CONTENDERS, AnyPolicy, contender
from ..scenario import Scenario
from .provenance import provenance
from .running import closed_loop
from .store import key_of

PLAYED = "played"
PLANT = ("zeta", "u_control", "u_disturbance", "cost", "attenuated", "tau_b")


def program_of(record: xr.Dataset, scenario: Scenario) -> str | None:
    """Return the name of the user's file that a record's run had, None if it had none."""
    kind, rule = str(record.attrs["kind"]), scenario.learner.rule
    if is_named(kind):
        return kind
    learns = kind in CONTENDERS and CONTENDERS[kind].law is None
    return rule if learns and is_named(rule) else None


def with_program(
    record: xr.Dataset, scenario: Scenario, policy: str
) -> tuple[Scenario, Callable[[Scenario], AnyPolicy], list[str]]:
    """Return the scenario with the user's program in it, what makes its policy, and its file's content.

    Raises
    ------
    InputError
        If the file is not that of the record, or can't be loaded.
    """
    if not is_named(policy):
        raise InputError(f"--policy is '{policy}', but must be file.py:function")
    kind, content = str(record.attrs["kind"]), [file_content(policy)]
    if key_of(*content) != record.attrs.get("program"):
        raise InputError(
            f"'{policy}' is not the program '{program_of(record, scenario)}' that the run had: the "
            "hash of its file is another; give that file, or leave out --policy to play the inputs back"
        )
    if is_named(kind):
        return scenario, contender(policy).make, content
    taught = scenario.with_settings(learner={"rule": policy})
    return taught, CONTENDERS[kind].make, content


def played_back(record: xr.Dataset, scenario: Scenario, progress: Progress | None) -> xr.Dataset:
    """Return the record of the plant under the inputs that the run had; nothing of its policy."""
    kind = str(record.attrs["kind"])
    simulation = {} if scenario.problem else {"observer_bandwidth": 0.0, "thruster_limits": False}
    plant = scenario.with_settings(simulation=simulation)
    setup = plant.setup()
    policy: AnyPolicy = Played(record, setup.problem)
    if isinstance(setup, StationKeeping):
        policy = PlayedOnVehicle(record, setup)
    made = to_dataset(closed_loop(plant, policy, progress), provenance(plant, kind, own=[]))
    made.attrs[PLAYED] = (
        f"its program '{program_of(record, scenario)}' is no part of the record, so the inputs that it "
        "gave were played back"
    )
    return of_the_plant(made)


def of_the_plant(record: xr.Dataset) -> xr.Dataset:
    """Return what of a record the plant made: nothing that only its policy knew."""
    return record[[name for name in PLANT if name in record]]


class Played:
    """The inputs of a record, one after the other.

    Attributes
    ----------
    u_control, u_disturbance : at the last state
    """

    def __init__(self, record: xr.Dataset, problem: Problem) -> None:
        self._controls, self._disturbances = (
            np.asarray(record[name].values, dtype=float) for name in ("u_control", "u_disturbance")
        )
        self.u_control, self.u_disturbance = np.zeros(problem.n_inputs), np.zeros(len(problem.game.W_d))
        self._next = 0

    def step(self, zeta: Array, dt: float) -> Array:
        """Return the recorded u_1 (k,); raises InputError where there are no more."""
        i, self._next = self._next, self._next + 1
        if i >= len(self._controls):
            raise InputError("the record holds no more inputs")
        self.u_control, self.u_disturbance = self._controls[i], self._disturbances[i]
        return self.u_control


class PlayedOnVehicle(Played):
    """The wrenches of a vehicle's record, one after the other."""

    def __init__(self, record: xr.Dataset, setup: StationKeeping) -> None:
        super().__init__(record, setup.problem)
        self.station = setup
        self._wrenches = np.asarray(record["tau_b"].values, dtype=float)
        self._eta = np.zeros(6)

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:  # type: ignore[override]
        """Return the recorded body wrench (6,); raises InputError where there are no more."""
        self._eta, i = eta, self._next
        super().step(eta, dt)
        return np.asarray(self._wrenches[i])

    def body_wrench(self, u: Array) -> Array:
        """Return J(η)'u at the last state, shape (6,)."""
        (J,) = self.station.model.kinematics(self._eta)
        return np.asarray(J.T @ u)
