"""The record of a run: named dimensions, units on every variable, provenance in the attributes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...symbolic import InputError, Problem
from ...symbolic.arrays import Array
from ..learning import MonitorSample
from ..loop import History
from ..vehicle import VehicleHistory
from .files import versions
from .reader import load

if TYPE_CHECKING:
    import xarray as xr

PLAYERS = ("control", "disturbance")
OVER_TIME = ("time", "zeta", "u_control", "disturbance", "cost", "attenuated")
OVER_LEARNING = (
    *("learn_time", "bellman_error", "sample_error", "projecting"),
    *("predicted_cost", "accepted", "fallback", "linear"),
    *("critic", "actor_1", "actor_2"),
)


def to_dataset(history: History, provenance: dict[str, Any]) -> xr.Dataset:
    """Return the record of a run.

    Dimensions: `time` (control steps), `learn_time` (learning steps, each with the weights before it,
    and the end of the run), `look_time` (looks of the monitor), `player` (control, disturbance),
    `state`, `input`, `basis`, and for a vehicle `force` and with thruster limits `thruster`. `tau_b` is
    the wrench that the vehicle got; `disturbance_estimate` is there with an observer. Attributes:
    `saturated`, the share of the control steps at which the least-norm thrusts exceeded a limit; median
    and mean wall time of a policy's step [us].
    """
    problem, m = history.problem, len(history.critic[0]) if history.critic else 0

    # an interrupt may have come between two appends
    n_time = _n_time(history)
    n_learn = min(len(getattr(history, name)) for name in OVER_LEARNING)

    def stack(name: str, width: int) -> Array:
        n = n_time if name in OVER_TIME else n_learn
        return np.array(getattr(history, name)[:n]).reshape(n, width)

    def series(name: str) -> Array:
        n = n_time if name in OVER_TIME else n_learn
        return np.array(getattr(history, name)[:n], dtype=float)

    variables = _variables(problem, stack, series, m) | _looks(history.looks)
    coordinates = {
        "time": ("time", series("time"), {"units": "s"}),
        "learn_time": ("learn_time", series("learn_time"), {"units": "s"}),
        "look_time": ("look_time", [look.time for look in history.looks], {"units": "s"}),
        "state": list(problem.state_names),
        "input": list(problem.input_names),
        "player": list(PLAYERS),
    }
    data: dict[str, tuple[tuple[str, ...], Array, dict[str, str]]] = {
        name: (dims, values, {"units": unit}) for name, (dims, values, unit) in variables.items()
    }
    attributes = {
        **provenance,
        **versions(),
        "stopped": history.stopped or "",
        "n_fallback": int(np.sum(history.fallback)),
    }
    if history.remembered is not None:
        data["remembered"] = (("basis",), history.remembered, {"units": "cost"})
    import xarray as xr  # takes a third of the time to load a controller

    return _with_vehicle(xr.Dataset(data, coordinates, attributes), history)


def _n_time(history: History) -> int:
    """Return the number of control steps of which everything was recorded."""
    return min(
        len(getattr(history, name))
        for name in (*OVER_TIME, *(("tau_b",) if isinstance(history, VehicleHistory) else ()))
    )


def listed(units: Sequence[str]) -> str:
    """Return units in their order, each once."""
    return ", ".join(dict.fromkeys(units))


def _variables(
    problem: Problem, stack: Callable[[str, int], Array], series: Callable[[str], Array], m: int
) -> dict[str, tuple[tuple[str, ...], Array, str]]:
    """Return dimensions, values and unit of every variable."""
    over_time, over_learning = ("time",), ("learn_time",)
    weights = ("learn_time", "basis")
    n, k, k_2 = problem.n_states, problem.n_inputs, len(problem.game.W_d)
    units = listed(problem.input_units)
    second = "input" if k_2 == k else "disturbance_input"
    return {
        "zeta": ((*over_time, "state"), stack("zeta", n), listed(problem.state_units)),
        "u_control": ((*over_time, "input"), stack("u_control", k), units),
        "u_disturbance": ((*over_time, second), stack("disturbance", k_2), units),
        "cost": (over_time, series("cost"), "cost"),
        "attenuated": (over_time, series("attenuated"), "cost"),
        "bellman_error": (over_learning, series("bellman_error"), "cost/s"),
        "sample_error": (over_learning, series("sample_error"), "1"),
        "projecting": (over_learning, series("projecting").astype(np.int8), "1"),
        "predicted_cost": (over_learning, series("predicted_cost"), "cost"),
        "accepted": (over_learning, series("accepted"), "1"),
        "fallback": (over_learning, series("fallback").astype(np.int8), "1"),
        "linear": (over_learning, series("linear").astype(np.int8), "1"),
        "critic": (weights, stack("critic", m), "cost"),
        "actor_1": (weights, stack("actor_1", m), "cost"),
        "actor_2": (weights, stack("actor_2", m), "cost"),
    }


def _looks(looks: list[MonitorSample]) -> dict[str, tuple[tuple[str, ...], Array, str]]:
    """Return dimensions, values and unit of what the monitor saw."""
    units = {
        **dict.fromkeys(("rank_margin", "rank_bound", "row_margin", "row_rank"), "1"),
        **dict.fromkeys(("regressor_normalized", "fixed_error_rms"), "1"),
        **{"regressor": "1/s", "fixed_error_max": "cost/s"},
    }
    variables: dict[str, tuple[tuple[str, ...], Array, str]] = {
        name: (("look_time",), np.array([getattr(look, name) for look in looks], dtype=float), unit)
        for name, unit in units.items()
    }
    for name in ("actor_norm", "actor_distance"):
        values = np.array([getattr(look, name) for look in looks]).reshape(len(looks), len(PLAYERS))
        variables[name] = (("look_time", "player"), values, "1")
    return variables


def _with_vehicle(record: xr.Dataset, history: History) -> xr.Dataset:
    """Return the record with the times of the policy, and with what only a vehicle has."""
    if isinstance(history, VehicleHistory):
        n_time, problem = record.sizes["time"], history.problem
        units = {"units": listed(problem.input_units)}
        tau_b = np.array(history.tau_b[:n_time]).reshape(n_time, problem.n_inputs)
        record["tau_b"] = (("time", "force"), tau_b, units)
        record = record.assign_coords(force=list(problem.input_names))
        if history.thrust:
            thrust = np.array(history.thrust[:n_time]).reshape(n_time, -1)
            record["thrust"] = (("time", "thruster"), thrust, {"units": "N"})
            record.attrs["saturated"] = float(np.mean(history.saturated))
        if history.estimate:
            estimate = np.array(history.estimate[:n_time])
            record["disturbance_estimate"] = (("time", "force"), estimate, units)
    seconds = history.policy_seconds or [0.0]
    record.attrs["policy_microseconds"] = 1e6 * float(np.median(seconds))
    record.attrs["policy_microseconds_mean"] = 1e6 * float(np.mean(seconds))
    return record


def load_weights(path: Path) -> Array:
    """Return ideal weights, those that a run remembers, or its last critic weights, shape (m,).

    Raises
    ------
    InputError
        If the file is neither.
    """
    dataset = load(path)
    if "ideal_weights" in dataset:
        weights = dataset["ideal_weights"].values
    elif "remembered" in dataset:
        weights = dataset["remembered"].values
    elif "critic" in dataset and dataset.sizes.get("learn_time", 0) > 0:
        weights = dataset["critic"].values[-1]
    else:
        raise InputError(
            f"'{path}' holds no learned weights; give the record of an online run or of ideal weights"
        )
    if not np.all(np.isfinite(weights)):
        raise InputError(f"the last weights of '{path}' are not finite; give the record of another run")
    return np.asarray(weights, dtype=np.float64)
