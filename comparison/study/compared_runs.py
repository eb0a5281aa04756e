"""The runs and the optima of a comparison from all states, made in parallel or reused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr

from ...offline import OfflineSolver
from ...symbolic import RunError
from ..merit import RunMetrics, regret, run_metrics
from ..parallel import Work, run_tasks
from ..records import KIND as CLAIRVOYANT
from ..records import clairvoyant_record, contender_record, optimal_record
from ..scenario import Scenario

Tell = Callable[[str, float], None]

EVERYWHERE = ("learned", "linear", "lqr", "pid", "mpc")  # run from every state
POLICIES = (*EVERYWHERE, "quadratic", "gradient")  # from the scenario's own
OPTIMUM = "optimal"


@dataclass(frozen=True)
class Optimum:
    """What a comparison keeps of the optimum from one state; a `fault` where there is none."""

    value: float | None
    value_error: float
    fault: str = ""


@dataclass(frozen=True)
class Made:
    """What was made, in the order of the states.

    Attributes
    ----------
    metrics : of each policy from each state that it was run from, with its regret
    optima : of the game
    clairvoyant : the clairvoyant optima in `disturbed` mode, else none
    """

    metrics: dict[str, list[RunMetrics]]
    optima: list[Optimum]
    clairvoyant: list[Optimum]


@dataclass(frozen=True)
class _Task:
    """A policy, or an optimum, from one of the states."""

    state: int
    what: str


def make_all(scenarios: list[Scenario], folder: Path, n_workers: int, tell: Tell) -> Made:
    """Make all records, or reuse those in `folder`.

    Raises
    ------
    RunError
        If a worker was lost.
    """
    disturbed = scenarios[0].simulation.mode == "disturbed"
    optima = (OPTIMUM, CLAIRVOYANT) if disturbed else (OPTIMUM,)
    tasks = [
        _Task(state, what)
        for state in range(len(scenarios))
        for what in (*optima, *(EVERYWHERE if state else POLICIES))
    ]
    answers: dict[_Task, RunMetrics | Optimum] = {}
    tell("runs", 0.0)
    with closing(run_tasks(_worker, (scenarios, folder), tasks, n_workers)) as events:
        for event in events:
            if event.message is None:
                raise RunError(str(event.failure))
            answers[tasks[event.task]] = event.message
            tell("runs", len(answers) / len(tasks))
    found: dict[str, list[Optimum]] = {OPTIMUM: [], CLAIRVOYANT: []}
    metrics: dict[str, list[RunMetrics]] = {name: [] for name in POLICIES}
    for task in tasks:
        answer = answers[task]
        if isinstance(answer, Optimum):
            found[task.what].append(answer)
        else:
            metrics[task.what].append(answer)
    references = found[CLAIRVOYANT if disturbed else OPTIMUM]
    for runs in metrics.values():
        runs[:] = [_regretted(run, references[i].value, disturbed) for i, run in enumerate(runs)]
    return Made(metrics, found[OPTIMUM], found[CLAIRVOYANT])


def record_path(folder: Path, state: int, what: str) -> Path:
    """Return where the record of a policy, or of an optimum, from one of the states is kept."""
    return folder / (f"state-{state + 1}-{what}.nc" if state else f"{what}.nc")


def _worker(shipment: tuple[list[Scenario], Path]) -> Work[_Task, RunMetrics | Optimum]:
    """Return what makes one record and tells its figures of merit."""
    scenarios, folder = shipment
    station = scenarios[0].station_keeping()
    solver = OfflineSolver(station.problem, scenarios[0].offline)

    def work(task: _Task) -> Iterator[RunMetrics | Optimum]:
        scenario, path = scenarios[task.state], record_path(folder, task.state, task.what)
        if task.what == OPTIMUM:
            yield _optimum(lambda: optimal_record(scenario, solver, path))
        elif task.what == CLAIRVOYANT:
            yield _optimum(lambda: clairvoyant_record(scenario, path))
        else:
            yield run_metrics(contender_record(scenario, task.what, path), station, None)

    return work


def _optimum(make: Callable[[], xr.Dataset]) -> Optimum:
    try:
        attributes = make().attrs
    except RunError as error:
        return Optimum(None, 0.0, " ".join(str(error).split()))
    value, accuracy = float(attributes["value"]), float(attributes["value_error"])
    return Optimum(value, accuracy, str(attributes["faults"]))


def _regretted(run: RunMetrics, optimum: float | None, disturbed: bool) -> RunMetrics:
    cost = run.running_cost if disturbed else run.cost
    return replace(run, regret=regret(cost, optimum))
