"""A sweep: many closed-loop runs into one table, killed and resumed at will.

A run is finished when its record is in place and its line in the journal. What is there already, with
the key that its settings, files and versions give, is not made again, whatever else the sweep asks for.
Nothing that is kept in memory grows with the number of runs but a few numbers of eight bytes.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ...online import load
from ...online.records import remove_temporaries, versions, written_whole
from ...symbolic import InputError
from ..parallel import Event, Work
from ..records import kept_key
from .sweep_plan import Plan, Run
from .sweep_run import FIGURES, FinishedRun, WorkerSettings, lost_row, worker
from .sweep_table import Journal, write_csv, write_netcdf

Setup = Callable[[WorkerSettings], Work[Run, FinishedRun]]
Execute = Callable[[Setup, WorkerSettings, Sequence[Run]], Generator[Event[FinishedRun], None, None]]
Progress = Callable[[int, int], None]
JOURNAL, RECORDS = "sweep.journal", "runs"


@dataclass(frozen=True, eq=False)
class Sweep:
    """The runs of a plan and what is there of them in a folder; hold its lock.

    Attributes
    ----------
    plan : which runs
    bench : what every worker is told
    folder : of journal, records and tables
    journal : the lines of finished runs
    places : (N,) where each run's line is, -1 for a run that is not finished
    """

    plan: Plan
    bench: WorkerSettings
    folder: Path
    journal: Journal = field(init=False)
    places: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        remove_temporaries(self.folder, "sweep.*")
        remove_temporaries(self.folder / RECORDS, "*.nc")
        object.__setattr__(self, "journal", Journal(self.folder / JOURNAL))
        object.__setattr__(self, "places", np.full(len(self.plan), -1, dtype=np.int64))

    def resume(self, progress: Progress) -> int:
        """Find the runs that are finished, their records intact; return how many.

        Parameters
        ----------
        progress : called with the number of runs looked at, twice
        """
        keys = (self.plan.run(number).key for number in range(len(self.plan)))
        there = (self.folder / RECORDS).is_dir()
        for number, place in enumerate(self.journal.offsets(keys)):
            if place >= 0:
                line = self.journal.at(place)
                if line["record"] in (None, self._checksum(line["key"])):
                    self.places[number] = place
            elif there:
                self._adopt(self.plan.run(number))
            progress(number + 1, number + 1)
        return self.n_finished

    def take_added(self) -> None:
        """Take the lines that were added, but not noted, when Ctrl-C came."""
        self.journal.read_again()
        keys = (self.plan.run(number).key for number in range(len(self.plan)))
        for number, place in enumerate(self.journal.offsets(keys)):
            if self.places[number] < 0:
                self.places[number] = place

    @property
    def n_finished(self) -> int:
        """Number of runs that are finished."""
        return int(np.count_nonzero(self.places >= 0))

    def go(self, execute: Execute, progress: Progress) -> None:
        """Make the runs that are missing, as `execute` does it: `pool.run_tasks`, or on a cluster.

        Parameters
        ----------
        progress : called with the number of finished runs and of those made now

        Raises
        ------
        InputError, RunError
            If what is finished can't be kept, or nobody is left to work; the rest is kept.
        """
        missing = _Missing(self.plan, np.flatnonzero(self.places < 0))
        before = self.n_finished
        with closing(execute(worker, self.bench, missing)) as events:
            for made, event in enumerate(events, 1):
                run = missing[event.task]
                if event.message is not None:
                    self._keep(run, event.message.row, event.message.record)
                else:
                    row = lost_row(run, self.bench.scenario, str(event.failure))
                    self._keep(run, row, None, lost=True)
                progress(before + made, made)

    def close(self) -> None:
        """Force the journal to the disk; raises InputError if that is not possible."""
        self.journal.close()

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of the finished runs in their order."""
        for number in np.flatnonzero(self.places >= 0):
            line = self.journal.at(int(self.places[number]))
            run = self.plan.run(int(number))
            record = f"{RECORDS}/{run.key}.nc" if line["record"] else ""
            here = {"run": run.number, "state": run.state, "record": record, "seed": self.plan.seed}
            yield line["row"] | here

    def write_tables(self) -> tuple[Path, Path]:
        """Write the rows of the finished runs as CSV and netCDF, and return both paths.

        Raises
        ------
        InputError
            If they can't be written.
        """
        units = self._columns()
        csv = write_csv(self.folder / "sweep.csv", list(units), self.rows())
        attributes = {
            **versions(),
            "scenario": self.plan.scenario.model_dump_json(),
            "policies": ", ".join(self.plan.policies),
            "seed": self.plan.seed,
            "sampling": self.plan.sampling,
            "planned_runs": len(self.plan),
        }
        n_rows = self.n_finished
        table = write_netcdf(self.folder / "sweep.nc", units, n_rows, self.rows(), attributes)
        return csv, table

    def _columns(self) -> dict[str, str | None]:
        """Return the columns of the table with their units, None for text."""
        columns: dict[str, str | None] = {"run": "1", "policy": None}
        for one in self.plan.choices:
            numbers = all(type(value) in (int, float) for value in one.values)
            columns[one.key] = "" if numbers else None
        columns |= {one.key: "" for one in self.plan.ranges}
        columns |= {"state": "1", "seed": "1"}
        problem = self.plan.scenario.setup().problem
        states = zip(problem.state_names, problem.state_units, strict=True)
        columns |= {f"initial_{name}": unit for name, unit in states}
        return columns | FIGURES | {"failed": "1", "reason": None, "unlearned": None, "record": None}

    def _keep(self, run: Run, row: dict[str, Any], record: bytes | None, lost: bool = False) -> None:
        """Put a run's record in place, then its line."""
        if record is not None:
            with written_whole(self._path(run.key)) as temporary:
                temporary.write_bytes(record)
        kept = None if record is None else [len(record), zlib.crc32(record)]
        line = {"key": run.key, "record": kept, "row": row} | ({"lost": True} if lost else {})
        self.places[run.number] = self.journal.add(line)

    def _adopt(self, run: Run) -> None:
        """Make the line of a record that is whole and has none."""
        path = self._path(run.key)
        if kept_key(path, "sweep_key") == run.key:
            with suppress(InputError, ValueError, KeyError):
                row = json.loads(load(path).attrs["row"])  # read to its end
                self._keep(run, row, path.read_bytes())

    def _checksum(self, key: str) -> list[int] | None:
        try:
            content = self._path(key).read_bytes()
        except OSError:
            return [-1, -1]
        return [len(content), zlib.crc32(content)]

    def _path(self, key: str) -> Path:
        return self.folder / RECORDS / f"{key}.nc"


class _Missing(Sequence[Run]):
    """Runs of a plan by their numbers, made up when they are asked for."""

    def __init__(self, plan: Plan, numbers: NDArray[np.int64]) -> None:
        self._plan = plan
        self._numbers = numbers

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, item: int) -> Run: ...
    @overload
    def __getitem__(self, item: slice) -> Sequence[Run]: ...
    def __getitem__(self, item: int | slice) -> Run | Sequence[Run]:
        if isinstance(item, slice):
            return _Missing(self._plan, self._numbers[item])
        return self._plan.run(int(self._numbers[item]))
