"""`stationkeep sweep` in a process group of its own, and its tables without times."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stationkeep.comparison.sweep.sweep_run import TIMES

from .commands import QUICK, script, sets
from .processes import Group

POLICIES = ("--policies", "learned,linear")
SETTINGS = (*POLICIES, *sets(*QUICK))


class Started(Group):
    """A sweep that was started."""

    def __init__(self, out: str, *more: str) -> None:
        words = [script(), "sweep", "--quiet", "--json", "--out", out, *SETTINGS, *more]
        super().__init__(words, Path(out))

    def finished(self) -> int:
        """Return the number of lines of the journal."""
        journal = self.folder / "sweep.journal"
        return journal.read_bytes().count(b"\n") if journal.is_file() else 0


def table(folder: str | Path) -> list[dict[str, str]]:
    """Return the rows of a sweep's table without its times."""
    with (Path(folder) / "sweep.csv").open(encoding="utf-8", newline="") as file:
        return [{k: v for k, v in row.items() if k not in TIMES} for row in csv.DictReader(file)]


class Cluster:
    """A dask scheduler and its workers, each a process that can be killed.

    Attributes
    ----------
    scheduler, workers : processes; the workers have no nanny that would start them again
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0")
        end = time.monotonic() + 60.0
        while not self.file.is_file():
            assert time.monotonic() < end
            time.sleep(0.05)
        self.address = str(json.loads(self.file.read_text(encoding="utf-8"))["address"])
        self.workers: list[subprocess.Popen[bytes]] = []
        for _ in range(2):
            self.add_worker()

    def add_worker(self) -> None:
        """Start another worker."""
        words = ("--nthreads", "1", "--no-nanny", "--local-directory", str(self.folder))
        self.workers.append(self._start("worker", *words))

    def _start(self, kind: str, *words: str) -> subprocess.Popen[bytes]:
        line = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard"]
        line += ["--scheduler-file", str(self.file), *words]
        return subprocess.Popen(
            line,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )


@contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    """Yield a cluster of two workers, of which nothing is left afterwards."""
    one = Cluster(folder)
    try:
        yield one
    finally:
        for process in (*one.workers, one.scheduler):
            process.kill()
            process.wait()
