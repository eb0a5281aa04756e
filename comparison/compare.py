"""Policies beside the optimum, from one scenario: runs, figures of merit, regret."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import xarray as xr

from ..offline import OfflineSolver
from ..online import draw_samples, load
from ..symbolic import RunError, StationKeeping
from .analysis import Field, analysis_record, ideal_of
from .conditions import Condition, check
from .contenders import CONTENDERS
from .excitation import ExcitationRun, excitation_runs
from .ideal import Ideal
from .metrics import GameValue, RunMetrics, dissipation_margin, distribution, run_metrics
from .pool import Work, run_tasks
from .run_conditions import run_conditions
from .runs import contender_record, optimal_record
from .scenario import Scenario
from .theory import Theory, theory

Tell = Callable[[str, float], None]

EVERYWHERE = ("learned", "linear", "lqr", "pid", "mpc")  # run from every state
POLICIES = (*EVERYWHERE, "quadratic", "gradient")  # from the scenario's own
JUDGED = ("learned", "linear")  # a run of theirs that ends early is a fault
OPTIMUM = "optimal"
X_Y = Field(0, 1)


@dataclass(frozen=True)
class Plan:
    """What is to be compared.

    Attributes
    ----------
    scenario : of all runs
    n_states : the scenario's initial state, and seeded ones of its envelope
    field : states over which the Bellman error is drawn
    """

    scenario: Scenario
    n_states: int = 1
    field: Field = X_Y

    def scenarios(self) -> list[Scenario]:
        """Return the scenario from each of the states."""
        envelope = self.scenario.station_keeping().envelope
        states = draw_samples(envelope, self.n_states - 1, self.scenario.simulation.seed)
        others = [
            self.scenario.with_settings(simulation={"initial_state": tuple(state.tolist())})
            for state in states
        ]
        return [self.scenario, *others]


@dataclass(frozen=True)
class Optimum:
    """What a comparison keeps of the optimum from one state; a `fault` where there is none."""

    value: float | None
    value_error: float
    fault: str = ""


@dataclass(frozen=True)
class Comparison:
    """What `compare` found.

    Attributes
    ----------
    scenario, station : what was compared
    records : closed-loop records from the scenario's initial state
    optimal : record of the offline optimum from there
    all_metrics : of each policy from each state that it was run from, the scenario's first
    optima : from each state
    margins : of each record from the scenario's state, in `disturbed` mode: the dissipation margin
    analysis : errors along and around the learned run, ideal weights; see `analysis_record`
    excitation : runs without and with samples
    conditions : the paper's assumptions and conditions, and what the learned run made of them
    theory : the theorem along the learned run, None without ideal weights
    """

    scenario: Scenario
    station: StationKeeping
    records: dict[str, xr.Dataset]
    optimal: xr.Dataset
    all_metrics: dict[str, list[RunMetrics]]
    optima: list[Optimum]
    margins: dict[str, float]
    analysis: xr.Dataset
    excitation: dict[str, list[ExcitationRun]]
    conditions: list[Condition]
    theory: Theory | None

    @property
    def metrics(self) -> dict[str, RunMetrics]:
        """Of each policy from the scenario's own state."""
        return {name: runs[0] for name, runs in self.all_metrics.items()}

    @property
    def n_states(self) -> int:
        """Number of initial states."""
        return len(self.optima)

    @property
    def value_error(self) -> float:
        """Largest relative value error of the optima."""
        return max(optimum.value_error for optimum in self.optima)

    @property
    def regrets(self) -> dict[str, list[float | None]]:
        """Of each policy from each state that has an optimum; None where a run ended early."""
        return {
            name: [
                run.regret
                for run, optimum in zip(runs, self.optima, strict=False)
                if optimum.value is not None
            ]
            for name, runs in self.all_metrics.items()
        }

    @property
    def regret(self) -> dict[str, dict[str, Any]] | None:
        """For each policy median, p90, max and the number that diverged.

        None in `disturbed` mode, where the game's optimum is no reference.
        """
        if self.scenario.simulation.mode != "game":
            return None
        return {name: distribution(regrets) for name, regrets in self.regrets.items()}

    @property
    def too_short(self) -> list[str]:
        """Policies whose run ended with more than a thousandth of the cost still to come."""
        return [name for name, metrics in self.metrics.items() if (metrics.rest_share or 0.0) > 1e-3]

    @property
    def faults(self) -> list[str]:
        """What did not converge: runs that ended early and certificates that failed."""
        found = []
        for number, optimum in enumerate(self.optima, 1):
            where = "" if number == 1 else f"state {number}, "
            if optimum.fault:
                found.append(f"{where}offline optimum: {optimum.fault}")
            for name in JUDGED:
                stopped = self.all_metrics[name][number - 1].stopped
                if stopped:
                    found.append(f"{where}{CONTENDERS[name].label}: {stopped}")
        return found


def compare(plan: Plan, folder: Path, *, n_workers: int = 1, tell: Tell | None = None) -> Comparison:
    """Run (or reuse from `folder`) every policy and the optimum from the same states.

    Parameters
    ----------
    folder : where records are kept; those that still fit the scenario are reused
    n_workers : processes that run at the same time
    tell : called with the name of the present stage and the part of it that is done

    Raises
    ------
    RunError
        If the offline solver does not converge from the scenario's own state, or a worker was lost.
    """
    told = tell if tell is not None else _silent
    scenario, station = plan.scenario, plan.scenario.station_keeping()
    scenarios = plan.scenarios()
    found, optima = _made(scenarios, folder, n_workers, told)
    if optima[0].value is None:
        raise RunError(optima[0].fault)
    if scenario.simulation.mode == "game":
        for runs in found.values():
            runs[:] = [_regretted(run, optima[i].value) for i, run in enumerate(runs)]
    records = {name: load(_path(folder, 0, name)) for name in POLICIES}
    told("errors along the way", 0.0)
    analysis = analysis_record(scenario, records["learned"], plan.field, folder / "analysis.nc")
    ideal = ideal_of(station, analysis)
    watched = None if ideal is None else theory(scenario, records["learned"], ideal)
    told("runs without and with samples", 0.0)
    return Comparison(
        scenario=scenario,
        station=station,
        records=records,
        optimal=load(_path(folder, 0, OPTIMUM)),
        all_metrics=found,
        optima=optima,
        margins=_margins(station, records) if scenario.simulation.mode == "disturbed" else {},
        analysis=analysis,
        excitation=excitation_runs(scenario),
        conditions=_conditions(scenario, records["learned"], ideal, watched),
        theory=watched,
    )


def _conditions(
    scenario: Scenario, learned: xr.Dataset, ideal: Ideal | None, watched: Theory | None
) -> list[Condition]:
    bounds = None if ideal is None else ideal.bounds
    listed = check(scenario, bounds, float(learned["rank_margin"].min()))
    return listed + run_conditions(scenario, learned, watched)


@dataclass(frozen=True)
class _Task:
    """A policy, or the optimum, from one of the states."""

    state: int
    what: str


def _made(
    scenarios: list[Scenario], folder: Path, n_workers: int, tell: Tell
) -> tuple[dict[str, list[RunMetrics]], list[Optimum]]:
    """Make all records; return the figures of merit and the optima, in the order of the states."""
    tasks = [
        _Task(state, what)
        for state in range(len(scenarios))
        for what in (OPTIMUM, *(EVERYWHERE if state else POLICIES))
    ]
    answers: dict[_Task, RunMetrics | Optimum] = {}
    tell("runs", 0.0)
    with closing(run_tasks(_worker, (scenarios, folder), tasks, n_workers)) as events:
        for event in events:
            if event.message is None:
                raise RunError(str(event.failure))
            answers[tasks[event.task]] = event.message
            tell("runs", len(answers) / len(tasks))
    metrics: dict[str, list[RunMetrics]] = {name: [] for name in POLICIES}
    optima = []
    for task in tasks:
        answer = answers[task]
        if isinstance(answer, Optimum):
            optima.append(answer)
        else:
            metrics[task.what].append(answer)
    return metrics, optima


def _worker(shipment: tuple[list[Scenario], Path]) -> Work[_Task, RunMetrics | Optimum]:
    """Return what makes one record and tells its figures of merit."""
    scenarios, folder = shipment
    station = scenarios[0].station_keeping()
    solver = OfflineSolver(station.problem, scenarios[0].offline)

    def work(task: _Task) -> Iterator[RunMetrics | Optimum]:
        scenario, path = scenarios[task.state], _path(folder, task.state, task.what)
        if task.what == OPTIMUM:
            yield _optimum(scenario, solver, path)
        else:
            yield run_metrics(contender_record(scenario, task.what, path), station, None)

    return work


def _optimum(scenario: Scenario, solver: OfflineSolver, path: Path) -> Optimum:
    try:
        attributes = optimal_record(scenario, solver, path).attrs
    except RunError as error:
        return Optimum(None, 0.0, str(error))
    value, accuracy = float(attributes["value"]), float(attributes["value_error"])
    return Optimum(value, accuracy, str(attributes["faults"]))


def _path(folder: Path, state: int, what: str) -> Path:
    return folder / (f"state-{state + 1}-{what}.nc" if state else f"{what}.nc")


def _regretted(run: RunMetrics, optimum: float | None) -> RunMetrics:
    if run.cost is None or optimum is None:
        return run
    return replace(run, regret=(run.cost - optimum) / optimum)


def _margins(station: StationKeeping, records: dict[str, xr.Dataset]) -> dict[str, float]:
    """Return the dissipation margin of the runs that did not end at once."""
    value = GameValue(station)
    ends = {name: record["zeta"].values[[0, -1]] for name, record in records.items()}
    return {
        name: dissipation_margin(records[name], value(first), value(last))
        for name, (first, last) in ends.items()
        if len(records[name]["time"]) > 1
    }


def _silent(name: str, part: float) -> None:
    """Tell nobody."""
