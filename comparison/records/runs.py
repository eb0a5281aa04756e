"""The runs of a scenario as records that are kept: made once, reused while nothing has changed."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...offline import (
    DirectSolution,
    EndedByLimitError,
    OfflineSolution,
    OfflineSolver,
    Reached,
    Trajectory,
)
from ...online import to_dataset
from ...online.loop import Progress
from ...online.records import listed, versions
from ...symbolic import RunError, Setup, StationKeeping
from ...symbolic.arrays import Array
from ..policies import AnyPolicy, contender
from ..scenario import Scenario
from .provenance import OFFLINE_KEY, provenance
from .record_files import with_files
from .running import closed_loop
from .store import reused


def online_record(
    scenario: Scenario,
    path: Path | None = None,
    *,
    policy: Callable[[], AnyPolicy] | None = None,
    kind: str = "learned",
    own: list[str] | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Return the record of a closed-loop run, from `path` if it holds this very run.

    Parameters
    ----------
    policy : makes what drives the vehicle; the scenario's controller if None
    kind : names the policy in the record
    own : what is in the user's files of law and policy; see `provenance`
    """
    attributes = provenance(scenario, kind, own=own)

    def make() -> xr.Dataset:
        history = closed_loop(scenario, None if policy is None else policy(), progress)
        attributes["wall_seconds"] = history.wall_seconds
        return with_files(to_dataset(history, attributes), scenario)

    record = reused(path, attributes["key"], make)
    if str(record.attrs["stopped"]).startswith("interrupted"):
        raise KeyboardInterrupt  # the part that was run is kept
    return record


def contender_record(
    scenario: Scenario, name: str, path: Path | None = None, progress: Progress | None = None
) -> xr.Dataset:
    """Return the record of a contender's run, from `path` if it holds this very run."""
    one = contender(name)
    changed = one.changed(scenario)
    return online_record(changed, path, policy=lambda: one.make(changed), kind=name, progress=progress)


def optimal_record(
    scenario: Scenario, solver: OfflineSolver, path: Path | None = None, zeta0: Array | None = None
) -> xr.Dataset:
    """Return the record of the offline optimum from ζ_0, from `path` if it holds this very solve.

    Raises
    ------
    RunError
        If the solver does not converge; that is kept too.
    """
    start = scenario.initial_state if zeta0 is None else zeta0
    attributes = optimum_provenance(scenario, start)
    record = reused(
        path, attributes["key"], lambda: optimum_or_failure(scenario, solver, start, attributes)
    )
    if "failed" in record.attrs:
        raise RunError(str(record.attrs["failed"]))
    return record


def optimum_provenance(scenario: Scenario, zeta0: Array, guess: str = "") -> dict[str, Any]:
    """Return `provenance` of the optimum from ζ_0; `guess` is the key of the one it starts from."""
    kind = f"optimal from {zeta0.tolist()}" + (f", started from {guess}" if guess else "")
    return provenance(scenario, kind, OFFLINE_KEY)


def optimum_or_failure(
    scenario: Scenario,
    solver: OfflineSolver,
    zeta0: Array,
    attributes: dict[str, Any],
    guess: Trajectory | None = None,
) -> xr.Dataset:
    """Return the record of the optimum from ζ_0, or of the solver's failure there.

    A search that fails from `guess` starts again from the linear policy. Where that does not converge
    either the record holds the reason, `failed`, and no trajectory, but the one that the solver had
    reached where its limits ended it: `reached_zeta` and `reached_v`, with `reached_cost`.
    """
    started = time.perf_counter()
    try:
        solution = _solve(solver, zeta0, guess)
    except RunError as error:
        attributes = {
            **attributes,
            "failed": str(error),
            "certified_seconds": time.perf_counter() - started,
        }
        reached = error.reached if isinstance(error, EndedByLimitError) else None
        return failure_record(zeta0, attributes, reached)
    return optimum_to_dataset(scenario, solution, attributes)


def failure_record(
    zeta0: Array, attributes: dict[str, Any], reached: Reached | None = None
) -> xr.Dataset:
    """Return the record of a solve from ζ_0 that failed: the state, versions, what it had reached."""
    attributes = attributes | versions()
    record = xr.Dataset({"zeta": ("state", zeta0)}, attrs=attributes)
    if reached is None:
        return record
    states, v = (("reached_time", "state"), reached.states), (("reached_node", "input"), reached.v)
    times = {"reached_time": reached.times, "reached_node": reached.times[1:]}
    record = record.assign(reached_zeta=states, reached_v=v).assign_coords(times)
    return record.assign_attrs(reached_cost=reached.cost)


def _solve(solver: OfflineSolver, zeta0: Array, guess: Trajectory | None) -> OfflineSolution:
    if guess is not None:
        with suppress(RunError):
            solution = solver.solve(zeta0, guess)
            if not solution.faults:
                return solution
    return solver.solve(zeta0)


def trajectory_of(record: xr.Dataset) -> Trajectory:
    """Return the trajectory of an optimum's record, bit for bit the one that was kept."""
    return Trajectory(
        mesh=record["mesh"].values,
        times=record["time"].values,
        states=record["zeta"].values,
        v=record["v"].values,
        degree=int(record.attrs["degree"]),
    )


def optimum_to_dataset(
    scenario: Scenario, solution: OfflineSolution, attributes: dict[str, Any]
) -> xr.Dataset:
    """Return the record of an offline solution: trajectory, forces, cost and certificate."""
    path, direct = solution.direct.trajectory, solution.direct
    setup = scenario.setup()
    u_control, u_disturbance = path.players(setup.game)
    local = setup.game.local_cost(path.states[1:], u_control, u_disturbance)
    dataset = path_dataset(setup, path, u_control, local, attributes | _described(solution))
    forces, units = ("node", "input"), {"units": listed(setup.problem.input_units)}
    more = {
        "u_disturbance": (forces, u_disturbance, units),
        "v": (forces, path.v, units),
        "costate": (("state",), direct.costate, {"units": "cost per unit of the state"}),
    }
    return dataset.assign(more)


def path_dataset(
    setup: Setup,
    path: Trajectory,
    u_control: Array,
    local: Array,
    attributes: dict[str, Any],
) -> xr.Dataset:
    """Return the record of a collocated way: states, control, cost, and a vehicle's wrench.

    Parameters
    ----------
    u_control : (K d, k) at the collocation points
    local : (K d,) cost rate there
    """
    problem = setup.problem
    units = {"units": listed(problem.input_units)}
    data = {
        "zeta": (("time", "state"), path.states, {"units": listed(problem.state_units)}),
        "u_control": (("node", "input"), u_control, units),
        "local_cost": (("node",), local, {"units": "cost/s"}),
        "cost": (("time",), path.quadrature(local), {"units": "cost"}),
    }
    coordinates = {
        "time": ("time", path.times, {"units": "s"}),
        "node": ("node", path.times[1:], {"units": "s"}),
        "mesh": ("mesh", path.mesh, {"units": "s"}),
        "state": list(problem.state_names),
        "input": list(problem.input_names),
    }
    record = xr.Dataset(data, coordinates, attributes)
    if isinstance(setup, StationKeeping):
        tau_b = [
            setup.model.kinematics(zeta[:6])[0].T @ (u + setup.model.u_trim)
            for zeta, u in zip(path.states[1:], u_control, strict=True)
        ]
        record["tau_b"] = (("node", "force"), np.array(tau_b), units)
        record = record.assign_coords(force=list(problem.input_names))
    return record


def _described(solution: OfflineSolution) -> dict[str, Any]:
    """Return what a record's attributes tell of a solution: value, certificate, how it was found."""
    direct, path = solution.direct, solution.direct.trajectory
    return {
        **versions(),
        **{name: float(value) for name, value in vars(solution.certificate).items()},
        "degree": path.degree,
        "intervals": len(path.mesh) - 1,
        "rounds": solution.rounds,
        "method": direct.method,
        "extremals": json.dumps([_extremal(solution, other) for other in solution.others]),
        "value": direct.value,
        "iterations": direct.iterations,
        "seconds": direct.seconds,
        "certified_seconds": solution.seconds,
        "faults": "; ".join(solution.faults),
        "turns": json.dumps(list(solution.turns)),
    }


def _extremal(solution: OfflineSolution, other: DirectSolution) -> dict[str, Any]:
    """Return what is told of a further extremal: by how much it is dearer, relative to the value."""
    return {
        "value": other.value,
        "gap": (other.value - solution.value) / solution.value,
        "second_order": other.second_order,
        "costate": other.costate.tolist(),
    }
