"""The runs and the optima of a comparison from all states, made in parallel or reused."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr

from ...offline import OfflineSolver, QuickValue
from ...symbolic import RunError, Setup
from ...symbolic.pyfile import is_named
from ..merit import RunMetrics, regret, run_metrics
from ..parallel import Work, run_tasks
from ..policies import available, label_of
from ..records import KIND as CLAIRVOYANT
from ..records import clairvoyant_record, contender_record, optimal_record
from ..scenario import Scenario
from .reference import OPTIMUM, Optimum, Reference, reference_of

Tell = Callable[[str, float], None]

ALONE = ("quadratic", "gradient")  # variants of the learned policy: from the scenario's own state


@dataclass(frozen=True)
class ComparedRuns:
    """What was made, in the order of the states.

    Attributes
    ----------
    metrics : of each policy from each state that it was run from, with its regret
    optima : by kind, of the game, and what else runs are held against
    """

    metrics: dict[str, list[RunMetrics]]
    optima: dict[str, list[Optimum]]


def policies(setup: Setup, own: Sequence[str] = ()) -> list[str]:
    """Return the names of the policies for a problem, those that are run from every state first.

    `own`: "file.py:make" of the user's.
    """
    return sorted([*available(setup), *own], key=lambda name: name in ALONE)


def everywhere(setup: Setup, own: Sequence[str] = ()) -> list[str]:
    """Return the names of the policies that are run from every state."""
    return [name for name in policies(setup, own) if name not in ALONE]


@dataclass(frozen=True)
class _Task:
    """A policy, or an optimum, from one of the states."""

    state: int
    what: str


def make_all(
    scenarios: list[Scenario], own: Sequence[str], folder: Path, n_workers: int, tell: Tell
) -> ComparedRuns:
    """Make all records, or reuse those in `folder`, with policies of the user's `own`.

    Raises
    ------
    RunError
        If a worker was lost.
    """
    reference, setup = reference_of(scenarios[0]), scenarios[0].setup()
    tasks = [
        _Task(state, what)
        for state in range(len(scenarios))
        for what in (*reference.solved, *(everywhere if state else policies)(setup, own))
    ]
    answers: dict[_Task, RunMetrics | Optimum] = {}
    tell("runs", 0.0)
    with closing(run_tasks(_worker, (scenarios, folder), tasks, n_workers)) as events:
        for event in events:
            if event.message is None:
                raise RunError(str(event.failure))
            answers[tasks[event.task]] = event.message
            tell("runs", len(answers) / len(tasks))
    found: dict[str, list[Optimum]] = {kind: [] for kind in reference.solved}
    metrics: dict[str, list[RunMetrics]] = {name: [] for name in policies(setup, own)}
    for task in tasks:
        answer = answers[task]
        if isinstance(answer, Optimum):
            found[task.what].append(answer)
        else:
            metrics[task.what].append(answer)
    for runs in metrics.values():
        pairs = zip(runs, found[reference.kind], strict=False)
        runs[:] = [_regretted(run, optimum.value, reference) for run, optimum in pairs]
    return ComparedRuns(metrics, found)


def record_path(folder: Path, state: int, what: str) -> Path:
    """Return where the record of a policy, or of an optimum, from one of the states is kept."""
    what = f"own-{label_of(what)}" if is_named(what) else what
    return folder / (f"state-{state + 1}-{what}.nc" if state else f"{what}.nc")


def _worker(shipment: tuple[list[Scenario], Path]) -> Work[_Task, RunMetrics | Optimum]:
    """Return what makes one record and tells its figures of merit."""
    scenarios, folder = shipment
    setup = scenarios[0].setup()
    solver = OfflineSolver(setup.problem, scenarios[0].offline)
    value = QuickValue(setup.problem)

    def work(task: _Task) -> Iterator[RunMetrics | Optimum]:
        scenario, path = scenarios[task.state], record_path(folder, task.state, task.what)
        if task.what == OPTIMUM:
            yield _optimum(lambda: optimal_record(scenario, solver, path))
        elif task.what == CLAIRVOYANT:
            yield _optimum(lambda: clairvoyant_record(scenario, path))
        else:
            record = contender_record(scenario, task.what, path)
            yield run_metrics(record, setup, None, value)

    return work


def _optimum(make: Callable[[], xr.Dataset]) -> Optimum:
    try:
        attributes = make().attrs
    except RunError as error:
        return Optimum(None, 0.0, " ".join(str(error).split()))
    value, accuracy = float(attributes["value"]), float(attributes["value_error"])
    return Optimum(value, accuracy, str(attributes["faults"]))


def _regretted(run: RunMetrics, optimum: float | None, reference: type[Reference]) -> RunMetrics:
    return replace(run, regret=regret(reference.cost(run), optimum))
