"""One run of a sweep: a row of the table and a small record. Works in any process, on no files."""

from __future__ import annotations

import json
import time
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr

from ...offline import QuickValue
from ...symbolic import RunError, Setup, StationkeepError
from ...symbolic.arrays import Array
from ..merit import dissipation_margin, run_metrics
from ..parallel import Work
from ..records import contender_record
from ..scenario import Scenario
from .sweep_plan import Run

Records = Literal["all", "failed", "none"]
LEARNING = 10  # the weights are kept that much more rarely than the motion
N_SETUPS = 4  # built ones that a worker remembers
# what a setting can make of a run; anything else is a fault of the program
FAULTS = (StationkeepError, ArithmeticError, ValueError, RuntimeError, MemoryError)
FIGURES: dict[str, str] = {
    "cost": "cost",
    "optimum": "cost",
    "regret": "1",
    "regret_error": "1",
    "dissipation_margin": "cost",
    "position_rms": "m",
    "excursion": "m",
    "effort": "N^2 s",
    "energy": "J",
    "saturated": "1",
    "peak_thrust": "1",
    "rest_share": "1",
    "fallback": "1",
    "ended": "s",
    "policy_microseconds": "us",
    "policy_mean": "us",
    "seconds": "s",
}
TIMES = ("policy_microseconds", "policy_mean", "seconds")


@dataclass(frozen=True)
class WorkerSettings:
    """What every worker is told.

    Attributes
    ----------
    scenario : what the runs vary
    records : of which runs records are kept
    every : time between the kept points of a record [s]; 0 keeps all
    """

    scenario: Scenario
    records: Records = "all"
    every: float = 0.2

    def __str__(self) -> str:
        return f"records {self.records} every {self.every!r} s"


@dataclass(frozen=True)
class FinishedRun:
    """A run that is over.

    Attributes
    ----------
    row : its figures; those that are not known are None
    record : netCDF file, or None if none is kept
    """

    run: Run
    row: dict[str, Any]
    record: bytes | None


def worker(bench: WorkerSettings) -> Work[Run, FinishedRun]:
    """Return what makes a run, for `pool.run_tasks`."""
    setups = _Setups()

    def work(run: Run) -> Iterator[FinishedRun]:
        with np.errstate(all="ignore"):  # a run that diverges says so in its row
            finished = _finished(bench, setups, run)
        yield finished

    return work


def lost_row(run: Run, scenario: Scenario, reason: str) -> dict[str, Any]:
    """Return the row of a run that gave no figures, and why."""
    zeta = scenario.initial_state.tolist() if run.zeta is None else run.zeta
    names = scenario.setup().problem.state_names
    states = {f"initial_{name}": value for name, value in zip(names, zeta, strict=True)}
    head = {"run": run.number, "policy": run.policy, "state": run.state}
    row: dict[str, Any] = head | run.settings | states
    return row | dict.fromkeys(FIGURES) | {"failed": True, "reason": reason, "unlearned": ""}


class _Setups:
    """The last setups that were built, each with what finds V* there and remembers the last one."""

    def __init__(self) -> None:
        self._known: OrderedDict[str, tuple[Setup, QuickValue]] = OrderedDict()

    def of(self, scenario: Scenario) -> tuple[Setup, QuickValue]:
        """Return the scenario's setup, built once, and give it to the scenario."""
        text = scenario.setup_text()
        if text not in self._known:
            setup = scenario.setup()
            self._known[text] = setup, QuickValue(setup.problem)
            if len(self._known) > N_SETUPS:
                self._known.popitem(last=False)
        self._known.move_to_end(text)
        setup, value = self._known[text]
        scenario.use_setup(setup)
        return setup, value


def _finished(bench: WorkerSettings, setups: _Setups, run: Run) -> FinishedRun:
    started = time.perf_counter()
    row, record = lost_row(run, bench.scenario, ""), None
    try:
        scenario = run.scenario(bench.scenario)
        row |= lost_row(run, scenario, "")
        setup, value = setups.of(scenario)
        record = contender_record(scenario, run.policy)
        row |= _figures(record, setup, value)
    except FAULTS as error:
        row["reason"] = " ".join(str(error).split()) or type(error).__name__
    row["failed"] = bool(row["reason"])
    row["seconds"] = time.perf_counter() - started
    kept = bench.records == "all" or (bench.records == "failed" and row["failed"])
    if record is None or not kept:
        return FinishedRun(run, row, None)
    small = thinned(record, bench.every)
    small.attrs |= {"sweep_key": run.key, "row": json.dumps(row)}
    return FinishedRun(run, row, bytes(small.to_netcdf(engine="h5netcdf")))


def _figures(record: xr.Dataset, setup: Setup, value: QuickValue) -> dict[str, Any]:
    zeta, fallback = record["zeta"].values, record["fallback"].values
    time_axis = record["time"].values
    row: dict[str, Any] = {"reason": str(record.attrs["stopped"])}
    disturbed = record.attrs["mode"] == "disturbed"
    if not disturbed and len(zeta):
        try:
            row["optimum"] = value(zeta[0])
        except RunError as error:
            row["reason"] = row["reason"] or f"the optimum is not known: {error}"
    found = vars(run_metrics(record, setup, row.get("optimum"), value))
    row |= {name: found[name] for name in FIGURES if name in found}
    if found["regret"] is not None:
        row["regret_error"] = QuickValue.error + found["cost_error"]
    row["unlearned"] = found["unlearned"] or ""
    row["fallback"] = float(fallback.mean()) if len(fallback) else None
    row["ended"] = float(time_axis[-1]) if len(time_axis) else None
    if disturbed and len(zeta) and not row["reason"]:
        try:
            row["dissipation_margin"] = dissipation_margin(record, value(zeta[0]), value(zeta[-1]))
        except RunError as error:
            row["reason"] = f"the optimum is not known: {error}"
    return row


def thinned(record: xr.Dataset, every: float) -> xr.Dataset:
    """Return the record with a point every so many seconds, of the weights 10 times as rarely.

    First and last points are kept, so costs and final weights are those of the run.
    """
    if every <= 0.0:
        return record
    rows = {
        name: _spaced(record[name].values, every if name == "time" else LEARNING * every)
        for name in map(str, record.dims)
        if name == "time" or name.endswith("_time")
    }
    return record.isel(rows).assign_attrs(thinned=every)


def _spaced(times: Array, spacing: float) -> Any:
    """Return indices of times at least that far apart, and of the last one."""
    chosen: list[int] = []
    for i, t in enumerate(times):
        if not chosen or t - times[chosen[-1]] >= spacing - 1e-9:
            chosen.append(i)
    if len(times) and chosen[-1] != len(times) - 1:
        chosen.append(len(times) - 1)
    return np.array(chosen, dtype=int)
