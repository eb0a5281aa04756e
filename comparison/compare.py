"""Learned beside optimal, from one scenario: runs, regret, figures and report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from ..offline import OfflineSolver
from ..online import draw_samples
from ..symbolic import StationKeeping
from ..symbolic.vehicle import Array
from .conditions import Condition, check
from .contenders import CONTENDERS
from .excitation import ExcitationRun, excitation_runs
from .metrics import RunMetrics, distribution, run_metrics
from .runs import contender_record, optimal_record
from .scenario import Scenario

Stage = Callable[[str, float], None]

# the cases that are run from the scenario's own state
POLICIES = ("learned", "linear", "quadratic", "gradient")
JUDGED = ("learned", "linear")  # from every state; one that ends early is a fault


@dataclass(frozen=True)
class Comparison:
    """What `compare` found.

    Attributes
    ----------
    scenario, station : what was compared
    records : closed-loop records from the scenario's initial state, `learned` and `linear` first
    optimal : record of the offline optimum
    metrics : of each record
    regret : for each policy median, p90, max over the states and the number that diverged; None in
        `disturbed` mode, where the game's optimum is no reference
    n_states : states compared: the scenario's, and seeded ones of the envelope
    value_error : largest relative value error of the optima
    excitation : runs without and with samples
    conditions : the paper's assumptions and conditions
    """

    scenario: Scenario
    station: StationKeeping
    records: dict[str, xr.Dataset]
    optimal: xr.Dataset
    metrics: dict[str, RunMetrics]
    regret: dict[str, dict[str, Any]] | None
    n_states: int
    value_error: float
    excitation: dict[str, list[ExcitationRun]]
    conditions: list[Condition]

    @property
    def too_short(self) -> list[str]:
        """Policies whose run ended with more than a thousandth of the cost still to come."""
        return [name for name, metrics in self.metrics.items() if (metrics.rest_share or 0.0) > 1e-3]

    @property
    def faults(self) -> list[str]:
        """What did not converge: runs that ended early and certificates that failed."""
        ended = [
            f"{CONTENDERS[name].label}: {metrics.stopped}"
            for name, metrics in self.metrics.items()
            if metrics.stopped and name in JUDGED
        ]
        failed = str(self.optimal.attrs["faults"])
        return ended + ([f"offline optimum: {failed}"] if failed else [])


def compare(
    scenario: Scenario, folder: Path, *, n_states: int = 1, stage: Stage | None = None
) -> Comparison:
    """Run (or reuse from `folder`) the learner, the baselines and the optimum from the same state.

    Parameters
    ----------
    folder : where records are kept; those that still fit the scenario are reused
    n_states : more than 1 adds seeded states of the envelope, each with its own runs and optimum
    stage : called with the name of the present stage and the part of it that is done

    Raises
    ------
    RunError
        If the offline solver does not converge.
    """
    tell = stage if stage is not None else _silent
    station = scenario.station_keeping()
    records = _closed_loops(scenario, folder, tell)
    tell("offline optimum", 0.0)
    solver = OfflineSolver(station.problem, scenario.offline)
    optimal = optimal_record(scenario, solver, folder / "optimal.nc")
    game_mode = scenario.simulation.mode == "game"
    optimum = float(optimal.attrs["value"]) if game_mode else None
    metrics = {name: run_metrics(record, station, optimum) for name, record in records.items()}
    regrets = {name: [metric.regret] for name, metric in metrics.items()}
    errors = [float(optimal.attrs["value_error"])]
    if game_mode:
        states = draw_samples(station.envelope, n_states - 1, scenario.simulation.seed)
        for i, zeta0 in enumerate(states):
            tell(f"envelope states, {i + 1} of {n_states - 1}", 0.0)
            errors.append(_another_state(scenario, solver, folder, i, zeta0, regrets))
    tell("runs without and with samples", 0.0)
    excitation = excitation_runs(scenario)
    return Comparison(
        scenario=scenario,
        station=station,
        records=records,
        optimal=optimal,
        metrics=metrics,
        regret={n: distribution(values) for n, values in regrets.items()} if game_mode else None,
        n_states=n_states if game_mode else 1,
        value_error=max(errors),
        excitation=excitation,
        conditions=check(scenario),
    )


def _closed_loops(scenario: Scenario, folder: Path, tell: Stage) -> dict[str, xr.Dataset]:
    duration = scenario.simulation.duration

    def progress(name: str) -> Callable[[float], None]:
        return lambda t: tell(f"{CONTENDERS[name].label}, run", t / duration)

    return {
        name: contender_record(scenario, name, folder / f"{name}.nc", progress(name))
        for name in POLICIES
    }


def _another_state(
    scenario: Scenario,
    solver: OfflineSolver,
    folder: Path,
    index: int,
    zeta0: Array,
    regrets: dict[str, list[float | None]],
) -> float:
    """Compare from one more state; append to `regrets` and return the optimum's value error."""
    there = scenario.with_settings(simulation={"initial_state": tuple(zeta0.tolist())})
    station = there.station_keeping()
    name = f"state-{index + 2}"
    optimal = optimal_record(there, solver, folder / f"{name}-optimal.nc", zeta0)
    value = float(optimal.attrs["value"])
    for kind in JUDGED:
        record = contender_record(there, kind, folder / f"{name}-{kind}.nc")
        regrets[kind].append(run_metrics(record, station, value).regret)
    return float(optimal.attrs["value_error"])


def _silent(name: str, part: float) -> None:
    """Tell nobody."""
