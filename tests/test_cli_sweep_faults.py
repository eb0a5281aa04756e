"""Sweeps with real kills: all at once, a worker, the scheduler, a full disk, two at the same time."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison.parallel import locked
from stationkeep.online import load

from .commands import call, files_in, sets
from .sweeps import SETTINGS, Started, cluster, table

Capture = pytest.CaptureFixture[str]
QUIET = ("sweep", "--quiet", "--json", "--workers", "1", *SETTINGS)


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def started() -> Iterator[list[Started]]:
    """Collect sweeps, of which nothing is left after the test."""
    sweeps: list[Started] = []
    yield sweeps
    for sweep in sweeps:
        if sweep.process.poll() is None:
            sweep.kill()


def assert_as_undisturbed(states: int, folder: Path, capsys: Capture) -> None:
    """The table is that of a sweep in one process that nothing happened to, digit for digit."""
    answer = call(capsys, *QUIET, "--out", "undisturbed", "--states", str(states))
    assert answer.code == 0, answer.err
    assert table("out") == table("undisturbed")
    assert not [name for name in files_in(folder) if Path(name).name.startswith(".")]


@pytest.mark.slow
def test_killed_and_resumed_with_a_worker_lost(
    user_folder: Path, capsys: Capture, started: list[Started]
) -> None:
    first = Started("out", "--states", "6", "--workers", "2")
    started.append(first)
    first.wait_for(2)
    first.kill()
    kept = first.finished()
    assert not (user_folder / "out" / "sweep.csv").exists()
    second = Started("out", "--states", "6", "--workers", "2")
    started.append(second)
    second.wait_for(kept + 1)
    os.kill(second.workers()[0], signal.SIGKILL)
    answer = second.answer()
    assert (answer.code, answer.err) == (0, "")
    assert answer.json()["resumed"] >= kept - 1  # a torn line is a run that was not finished
    assert_as_undisturbed(6, user_folder, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_killed_at_random_moments_again_and_again(
    seed: int, user_folder: Path, capsys: Capture, started: list[Started]
) -> None:
    rng = np.random.default_rng(seed)
    for kill in range(4):
        sweep = Started("out", "--states", "16", "--workers", str(rng.integers(1, 4)))
        started.append(sweep)
        if kill > 0:
            sweep.wait_for(sweep.finished() + int(rng.integers(1, 6)))
        time.sleep(float(rng.uniform(0.0, 0.4)))
        sweep.kill()
    assert 3 <= sweep.finished() < 32
    last = Started("out", "--states", "16", "--workers", "2")
    started.append(last)
    assert last.answer().code == 0
    assert_as_undisturbed(16, user_folder, capsys)


@pytest.mark.slow
def test_ctrl_c_leaves_whole_results(user_folder: Path, started: list[Started]) -> None:
    """As a terminal does it: the whole group is told."""
    sweep = Started("out", "--states", "50", "--workers", "2")
    started.append(sweep)
    sweep.wait_for(3)
    os.killpg(sweep.process.pid, signal.SIGINT)
    answer = sweep.answer(timeout=30.0)
    assert answer.code == 1
    assert answer.out == ""
    assert answer.sentence().startswith("interrupted")
    rows = table("out")
    assert 3 <= len(rows) == sweep.finished() < 100
    for row in rows:
        assert load(user_folder / "out" / row["record"])["time"].values[-1] == 2.0
    assert not [name for name in files_in(user_folder) if Path(name).name.startswith(".")]


def test_two_sweeps_into_one_folder(user_folder: Path, capsys: Capture) -> None:
    (user_folder / "out").mkdir()
    with locked(user_folder / "out"):
        answer = call(capsys, *QUIET, "--out", "out")
    assert answer.code == 2
    for word in ("another run", f"process {os.getpid()}", "'out'", "--out"):
        assert word in answer.sentence()
    assert files_in(user_folder) == []


@pytest.mark.slow
def test_a_disk_that_fills_up(user_folder: Path, capsys: Capture) -> None:
    """A file system of 200 kB: what fitted is kept, and goes on where there is room."""
    (user_folder / "out").mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", "out"], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("no file system can be mounted here")
    try:
        for workers in ("1", "2"):
            answer = Started("out", "--states", "6", "--workers", workers).answer()
            assert answer.code == 2
            assert "can't be written (No space left on device)" in answer.sentence()
            kept = (user_folder / "out" / "sweep.journal").read_bytes().count(b"\n")
            assert 2 <= kept < 12
        subprocess.run(["mount", "-o", "remount,size=20m", "out"], check=True)
        resumed = Started("out", "--states", "6").answer()
        assert resumed.code == 0
        assert resumed.json()["resumed"] == kept
        assert_as_undisturbed(6, user_folder, capsys)
    finally:
        subprocess.run(["umount", "out"], check=True)


@pytest.mark.slow
def test_through_a_cluster_with_a_worker_lost_then_the_scheduler(
    user_folder: Path, capsys: Capture, started: list[Started], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker killed mid-run is made up for; without scheduler it ends, and goes on anywhere."""
    (user_folder / "dask").mkdir()
    with cluster(user_folder / "dask") as dask:
        words = ("--states", "30", "--cluster", dask.address)
        with monkeypatch.context() as patch:
            patch.setattr(
                "stationkeep.comparison.parallel.cluster.versions",
                lambda: {"stationkeep_version": "99"},
            )
            answer = call(capsys, *QUIET[:3], *SETTINGS, *words)
        assert answer.code == 2
        assert "needs stationkeep 99, but has: " in answer.sentence()
        sweep = Started("out", *words)
        started.append(sweep)
        sweep.wait_for(3)
        dask.workers[0].kill()
        dask.add_worker()
        sweep.wait_for(sweep.finished() + 6)
        dask.scheduler.kill()
        answer = sweep.answer(timeout=60.0)
    assert answer.code == 1
    assert answer.sentence().startswith(f"the scheduler {dask.address} was lost")
    rows = table("out")
    assert len(rows) >= 9
    assert all(row["failed"] == "False" for row in rows)
    resumed = Started("out", "--states", "30", "--workers", "2")
    started.append(resumed)
    last = resumed.answer()
    assert last.code == 0
    assert last.json()["resumed"] >= len(rows)
    assert_as_undisturbed(30, user_folder, capsys)


@pytest.mark.slow
def test_nobody_at_the_address(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stationkeep.comparison.parallel.cluster.CONNECT", "1s")
    answer = call(capsys, "sweep", "--quiet", "--cluster", "tcp://127.0.0.1:9", *sets(*SETTINGS[3::2]))
    assert answer.code == 2
    assert "no dask scheduler answers at 'tcp://127.0.0.1:9'" in answer.sentence()
