"""Runs per second of `stationkeep sweep`, its parallel efficiency, its table and its end after kills.

    python benchmarks/speed/sweep.py [speed] [table] [killed] [--runs N] [--duration T] [--seed N]

speed: N runs (learned and linear, default 200 of 20 s) by 1 and 2 processes and 2 workers of a dask
cluster on this machine; the efficiency of w workers is T_1 / (w T_w), whole commands, and, where other
programs share the cores, the same of processor times, C_1 / C_w. table: the table
of 10,000 runs (made up, not run), written and opened, and how memory grows with the number of runs.
killed: 1,000 runs of 2 s killed twice at random and resumed, and the same through the cluster, beside
the undisturbed sweep, row for row, without columns of times.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import csv
import json
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.parallel import Event
from stationkeep.comparison.sweep import FinishedRun, Plan, Run, Setup, Sweep, WorkerSettings
from stationkeep.comparison.sweep.sweep_run import FIGURES, TIMES, lost_row

COMMAND = [sys.executable, "-m", "stationkeep.cli.main", "sweep", "--quiet", "--json"]
SETTINGS = ["--scales", "0.35", "--policies", "learned,linear"]


def command(states: int, duration: float, out: Path, *more: str) -> list[str]:
    """Return the words of a sweep of 2 runs a state."""
    timing = ["--set", f"simulation.duration={duration}"]
    return [*COMMAND, *SETTINGS, "--states", str(states), *timing, "--out", str(out), *more]


@contextmanager
def cluster(folder: Path) -> Iterator[str]:
    """Yield the address of a scheduler with two workers, each a process with one thread."""
    file = folder / "scheduler.json"
    module = [sys.executable, "-m", "distributed.cli.dask_"]
    started = []

    def start(kind: str, *words: str) -> None:
        line = [
            *module[:-1],
            module[-1] + kind,
            "--scheduler-file",
            str(file),
            "--no-dashboard",
            *words,
        ]
        started.append(subprocess.Popen(line, stderr=subprocess.DEVNULL, start_new_session=True))

    try:
        start("scheduler", "--host", "127.0.0.1", "--port", "0")
        for _ in range(2):
            start("worker", "--nthreads", "1", "--local-directory", str(folder / "dask"))
        while not file.is_file():
            time.sleep(0.1)
        yield json.loads(file.read_text(encoding="utf-8"))["address"]
    finally:
        for process in reversed(started):
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()


def speed(folder: Path, options: argparse.Namespace) -> None:
    """Print runs per second and efficiencies."""
    states = options.runs // 2

    def seconds(name: str, *more: str, n: int = states) -> tuple[float, float]:
        """Return wall and processor time of a sweep."""
        started, used = time.perf_counter(), children()
        subprocess.run(
            command(n, options.duration, folder / name, *more), check=True, stdout=subprocess.DEVNULL
        )
        return time.perf_counter() - started, children() - used

    seconds("warm", n=1)  # compiles
    one, cpu_one = seconds("one", "--workers", "1")
    print(f"{options.runs} runs of {options.duration:g} s, learned and linear", flush=True)
    print(f"1 process    {options.runs / one:6.2f} runs/s", flush=True)
    two, cpu_two = seconds("two", "--workers", "2")
    print(
        f"2 processes  {options.runs / two:6.2f} runs/s, efficiency {one / two / 2:.2f}, of processor "
        f"times {cpu_one / cpu_two:.2f}",
        flush=True,
    )
    with cluster(folder) as address:
        time.sleep(5.0)  # its workers are there before a sweep begins
        dask, _ = seconds("dask", "--cluster", address)
    print(
        f"dask, 2      {options.runs / dask:6.2f} runs/s, efficiency {one / dask / 2:.2f}", flush=True
    )


def children() -> float:
    """Return the processor time of the processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def table(folder: Path) -> None:
    """Print how long 10,000 rows take to be opened, and the memory that more runs need."""
    scenario = Scenario.load()
    peaks = []
    for n in (10_000, 30_000):
        bench = WorkerSettings(scenario)
        plan = Plan(scenario, ("learned", "linear"), states=n // 2)
        (folder / str(n)).mkdir()
        tracemalloc.start()
        sweep = Sweep(plan, bench, folder / str(n))
        sweep.go(made_up, lambda done, made: None)
        _, file = sweep.write_tables()
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        sweep.close()
    file = folder / "10000" / "sweep.nc"
    started = time.perf_counter()
    with xr.open_dataset(file, engine="h5netcdf") as dataset:
        loaded = dataset.load()
    opened = time.perf_counter() - started
    started = time.perf_counter()
    with file.with_suffix(".csv").open(encoding="utf-8", newline="") as text:
        rows = sum(1 for _ in csv.DictReader(text))
    read = time.perf_counter() - started
    size = file.stat().st_size / 1e6
    print(
        f"{loaded.sizes['run']} runs: netCDF ({size:.1f} MB) opened whole in {opened:.2f} s, CSV of "
        f"{rows} rows read in {read:.2f} s; peak of 10,000 runs {peaks[0] / 1e6:.1f} MB, of 30,000 "
        f"{peaks[1] / 1e6:.1f} MB: {(peaks[1] - peaks[0]) / 20_000:.0f} bytes a run",
        flush=True,
    )


def made_up(
    setup: Setup, bench: WorkerSettings, runs: Sequence[Run]
) -> Generator[Event[FinishedRun], None, None]:
    """Yield rows of random numbers for all runs."""
    rng = np.random.default_rng(1)
    for i, run in enumerate(runs):
        figures = dict(zip(FIGURES, rng.random(len(FIGURES)).tolist(), strict=True))
        row = lost_row(run, bench.scenario, "") | figures | {"failed": False}
        yield Event(i, FinishedRun(run, row, None))


def killed(folder: Path, options: argparse.Namespace) -> None:
    """Print whether what was killed and what a cluster did equals the undisturbed sweep."""
    rng = np.random.default_rng(options.seed)
    states, n = options.runs // 2, options.runs
    out = folder / "killed"
    for kill in (1, 2):
        line = command(states, 2.0, out, "--workers", "2")
        process = subprocess.Popen(line, stdout=subprocess.DEVNULL, start_new_session=True)
        target = finished(out) + int(rng.integers(n // 10, n // 3))
        while finished(out) < target and process.poll() is None:
            time.sleep(0.05)
        time.sleep(float(rng.uniform(0.0, 0.3)))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        print(f"kill {kill}: {finished(out)} of {n} runs were finished", flush=True)
    undisturbed = rows(command(states, 2.0, folder / "undisturbed", "--workers", "2"))
    print(
        f"killed twice and resumed: {compared(rows(command(states, 2.0, out)), undisturbed)}",
        flush=True,
    )
    with cluster(folder) as address:
        through = rows(command(states, 2.0, folder / "cluster", "--cluster", address))
    print(f"through a dask cluster: {compared(through, undisturbed)}", flush=True)


def finished(out: Path) -> int:
    """Return the number of whole lines of the journal."""
    journal = out / "sweep.journal"
    return journal.read_bytes().count(b"\n") if journal.is_file() else 0


def rows(words: list[str]) -> list[dict[str, Any]]:
    """Run a sweep and return the rows of its table without times."""
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=False)
    with Path(json.loads(done.stdout)["csv"]).open(encoding="utf-8", newline="") as file:
        return [{k: v for k, v in row.items() if k not in TIMES} for row in csv.DictReader(file)]


def compared(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> str:
    """Return in words whether two tables are equal, text for text."""
    different = sum(a != b for a, b in zip(one, other, strict=False)) + abs(len(one) - len(other))
    return f"{len(one)} rows, {different} differ from those of the undisturbed sweep"


def main() -> None:
    """Read the options and print what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="*", choices=[[], "speed", "table", "killed"])
    parser.add_argument("--runs", type=int, help="200 for speed, 1000 for killed")
    parser.add_argument("--duration", type=float, default=20.0, help="of the runs of speed [s]")
    parser.add_argument("--seed", type=int, default=1, help="of the moments of the kills")
    options = parser.parse_args()
    given = options.runs
    for what in options.what or ["speed", "table", "killed"]:
        folder = Path(tempfile.mkdtemp())
        options.runs = given or (1000 if what == "killed" else 200)
        try:
            if what == "table":
                table(folder)
            else:
                {"speed": speed, "killed": killed}[what](folder, options)
        finally:
            shutil.rmtree(folder)


if __name__ == "__main__":
    main()
