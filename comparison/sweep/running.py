"""A sweep as one function: what the command does."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from ...online.records import writable_folder
from ...symbolic import InputError, StationkeepError
from ...symbolic.arrays import Array
from ..parallel import Event, default_workers, locked, run_on_cluster, run_tasks
from ..records import require_runnable
from ..scenario import Scenario
from .sweep import Execute, Setup, Sweep
from .sweep_plan import Plan, Run, Sampling
from .sweep_run import FinishedRun, WorkerSettings
from .sweep_summary import faults, summary
from .vary import parse_vary

Stage = Callable[[str, int, int, int], None]


@dataclass(frozen=True)
class SweepResult:
    """What a sweep found.

    Attributes
    ----------
    runs, failed, resumed : how many were asked for, failed, and were there already
    table, csv : the rows of all runs
    summary : for each setting and policy the quantiles over its runs
    faults : runs whose regret no policy can have (their optimum or their cost is wrong), and those that
        learned nothing although it was due
    seconds : wall time
    """

    runs: int
    failed: int
    resumed: int
    table: Path
    csv: Path
    summary: list[dict[str, Any]]
    faults: list[str]
    seconds: float


def sweep(
    scenario: Scenario | str,
    out: Path | str,
    *,
    policies: Sequence[str] = ("learned", "linear"),
    states: Array | int = 0,
    scales: Sequence[float] = (),
    vary: Sequence[str] = (),
    samples: int = 0,
    sampling: Sampling = "latin",
    seed: int | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    records: Literal["all", "failed", "none"] = "all",
    every: float = 0.2,
    progress: Stage | None = None,
) -> SweepResult:
    """Make the closed-loop runs that are missing in a folder; write journal, records and tables.

    Runs are the product of the varied settings, sampled points, initial states and policies. One that
    is there already is not made again, so that a killed sweep goes on where it was.

    Parameters
    ----------
    scenario : a scenario, or what `Scenario.load` takes
    out : folder of journal, records and tables
    policies : names, or "file.py:make"
    states : (N, n) initial states, or how many are drawn in the envelope; 0 is the scenario's own
    scales : of the envelope; short for vary=["envelope.scale=..."]
    vary : "section.key=value,value,..." or, sampled, "section.key=low:high" with `:log` behind it
    samples, sampling : number of sampled points, and how they are drawn
    seed : of states and points; the scenario's if None
    workers : processes; the number of cores if None
    cluster : address of a dask scheduler in place of processes of this machine
    records : which runs keep a record
    every : [s] between the points that a record keeps, 0 for all
    progress : called with the name of the stage, how many runs are done, how many were made now, and
        how many there are

    Raises
    ------
    InputError
        If what is asked for breaks a rule, or the folder can't be written; what is finished is kept.
    RunError
        If nobody is left to work.
    """
    started = time.monotonic()
    one = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario, varied=vary)
    require_runnable(one)
    told = progress if progress is not None else _silent
    bench = WorkerSettings(one, records, every)
    asked = [f"envelope.scale={','.join(map(str, scales))}"] if len(scales) else []
    plan = Plan(
        scenario=one,
        policies=tuple(policies),
        varied=parse_vary([*asked, *vary], one),
        n_points=samples,
        sampling=sampling,
        states=states,
        seed=one.simulation.seed if seed is None else seed,
        kept=str(bench),
    )
    execute = _executor(workers, cluster)
    folder = writable_folder(Path(out))
    with locked(folder), closing(Sweep(plan, bench, folder)) as going:
        resumed = _all_runs(going, execute, told)
        csv, table = going.write_tables()
        groups = summary(going.rows(), [choice.key for choice in plan.choices])
        found = faults(going.rows())
    return SweepResult(
        runs=len(plan),
        failed=sum(group["failed"] for group in groups),
        resumed=resumed,
        table=table,
        csv=csv,
        summary=groups,
        faults=found,
        seconds=time.monotonic() - started,
    )


def _all_runs(going: Sweep, execute: Execute, told: Stage) -> int:
    """Make what is missing; whatever happens, write the tables of what is finished."""
    if going.journal.broken:
        broken = f"{going.journal.broken} lines of the journal can't be read; their runs are made again"
        told(broken, 0, 0, going.journal.broken)
    of = len(going.plan)
    told("finished runs", 0, 0, of)
    resumed = going.resume(lambda seen, _: told("finished runs", seen, 0, of))
    told("sweep", resumed, 0, of)
    try:
        going.go(execute, lambda done, made: told("sweep", done, made, of))
    except (KeyboardInterrupt, StationkeepError):
        with suppress(InputError):
            going.take_added()
            going.write_tables()
        raise
    told("tables", 0, 0, of)
    return resumed


def _executor(workers: int | None, cluster: str | None) -> Execute:
    if cluster is not None:
        if workers is not None:
            raise InputError("--workers is for this machine; a cluster has workers of its own")
        return partial(run_on_cluster, cluster)
    number = default_workers() if workers is None else workers

    def here(
        setup: Setup, bench: WorkerSettings, runs: Sequence[Run]
    ) -> Generator[Event[FinishedRun], None, None]:
        return run_tasks(setup, bench, runs, number)

    return here


def _silent(stage: str, done: int, made: int, of: int) -> None:
    """Tell nobody."""
