"""Many states: killed at any moment and run again, interrupted, with a worker lost, twice at once."""

from __future__ import annotations

import csv
import json
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stationkeep.comparison.parallel import locked
from stationkeep.comparison.parallel.lock import NAME
from stationkeep.online import load

from .commands import LOOSE, QUICK, call, files_in, script, sets
from .games import HALF_WIDTHS, Array
from .processes import Group

Capture = pytest.CaptureFixture[str]
TINY = (
    *("offline.horizon=12", "offline.intervals=6", "offline.degree=4", "offline.aligned=false"),
    *("offline.rounds=1", "offline.starts=0"),
)
SETTINGS = sets(*QUICK, *TINY, *LOOSE)


def near_and_far(n: int, seed: int) -> Array:
    """Return n states of which about every second has a neighbour to start from."""
    rng = np.random.default_rng(seed)
    far = 0.3 * HALF_WIDTHS * rng.uniform(-1.0, 1.0, (n, 12))
    near = far[: n // 2] * rng.uniform(1.005, 1.025, (n // 2, 1))
    return np.asarray(rng.permutation(np.vstack([far[: n - n // 2], near])))


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Run(Group):
    """`offline` on a file of states."""

    def __init__(self, states: str, out: str, *more: str) -> None:
        words = [script(), "offline", "--quiet", "--json", "--states", states, "--out", out]
        super().__init__([*words, *SETTINGS, *more], Path(out))

    def finished(self) -> int:
        """Return the number of records that are there."""
        return len(list(self.folder.glob("optimal-*.nc")))


@pytest.fixture
def started() -> Iterator[list[Run]]:
    """Collect runs, of which nothing is left after the test."""
    runs: list[Run] = []
    yield runs
    for run in runs:
        if run.process.poll() is None:
            run.kill()


def without_times(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if "seconds" not in name}


def assert_equal(folder: str, reference: str) -> None:
    """Both folders hold the same numbers to 1e-9, in the JSON file and in the table."""
    one, other = (
        json.loads((Path(name) / "offline.json").read_text(encoding="utf-8"))["states"]
        for name in (folder, reference)
    )
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert a["faults"] == b["faults"]
        for name, value in without_times(b).items():
            if name == "certificate":
                assert a[name] == pytest.approx(value, rel=1e-9, abs=1e-9, nan_ok=True)
            elif name != "faults":
                given = a[name]
                assert (given is None) == (value is None)
                assert value is None or given == pytest.approx(value, rel=1e-9, abs=1e-9)
    tables = []
    for name in (folder, reference):
        with (Path(name) / "offline.csv").open(encoding="utf-8", newline="") as file:
            tables.append([without_times(row) for row in csv.DictReader(file)])
    for a, b in zip(*tables, strict=True):
        assert a["faults"] == b["faults"]
        keys = [key for key in b if key != "faults"]
        assert [a[key] == "" for key in keys] == [b[key] == "" for key in keys]
        known = [key for key in keys if b[key]]
        words = [key for key in known if b[key] in ("True", "False")]
        assert [a[key] for key in words] == [b[key] for key in words]
        numbers = [[float(row[key]) for key in known if key not in words] for row in (a, b)]
        np.testing.assert_allclose(*numbers, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_killed_and_resumed_with_a_worker_lost(
    user_folder: Path, capsys: Capture, started: list[Run]
) -> None:
    """All at once, then one worker of the second run, and the numbers are those of a quiet run."""
    np.save("states.npy", near_and_far(7, 1))
    first = Run("states.npy", "out")
    started.append(first)
    first.wait_for(1)
    first.kill()
    kept = {path.name: path.stat().st_mtime_ns for path in Path("out").glob("optimal-*.nc")}
    assert 1 <= len(kept) < 7
    assert not (user_folder / "out" / "offline.json").exists()
    second = Run("states.npy", "out")
    started.append(second)
    second.wait_for(len(kept) + 1)
    os.kill(second.workers()[0], signal.SIGKILL)
    answer = second.answer()
    assert answer.code == 0, answer.err
    assert answer.err == ""
    for name, modified in kept.items():
        assert (user_folder / "out" / name).stat().st_mtime_ns == modified, "what was finished is kept"
    quiet = ("--workers", "1", "--states", "states.npy", "--out", "quiet", *SETTINGS)
    assert call(capsys, "offline", "--quiet", *quiet).code == 0
    assert_equal("out", "quiet")
    assert not [name for name in files_in(user_folder) if Path(name).name.startswith(".")]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_killed_at_random_moments_again_and_again(
    seed: int, user_folder: Path, capsys: Capture, started: list[Run]
) -> None:
    """Once while it starts, then while it solves, with other numbers of workers each time."""
    rng = np.random.default_rng(seed)
    np.save("states.npy", near_and_far(24, seed))
    for kill in range(5):
        run = Run("states.npy", "out", "--workers", str(rng.integers(1, 4)))
        started.append(run)
        if kill > 0:
            run.wait_for(run.finished() + int(rng.integers(1, 4)))
        time.sleep(float(rng.uniform(0.0, 0.5)))
        assert run.process.poll() is None
        run.kill()
        assert not (user_folder / "out" / "offline.json").exists()
    assert 4 <= run.finished() < 24
    last = Run("states.npy", "out", "--workers", "2")
    started.append(last)
    assert last.answer().code == 0
    quiet = ("--workers", "1", "--states", "states.npy", "--out", "quiet", *SETTINGS)
    assert call(capsys, "offline", "--quiet", *quiet).code == 0
    assert_equal("out", "quiet")
    assert not [name for name in files_in(user_folder) if Path(name).name.startswith(".")]


@pytest.mark.slow
def test_states_that_fail_are_rows_and_the_others_are_solved(
    user_folder: Path, capsys: Capture
) -> None:
    """From 10 km away nothing converges."""
    far = np.zeros(12)
    far[0] = 1e4
    np.save("states.npy", np.array([far, 0.1 * HALF_WIDTHS]))
    words = ("offline", "--quiet", "--json", "--states", "states.npy", "--out", "out", *SETTINGS)
    answer = call(capsys, *words, "--workers", "2")
    assert answer.code == 1
    rows = answer.json()["states"]
    assert [row["value"] is None for row in rows] == [True, False]
    assert [row["zeta"][0] for row in rows] == [1e4, 0.1 * HALF_WIDTHS[0]]
    assert "Maximum_Iterations_Exceeded" in rows[0]["faults"][0]
    assert rows[0]["certified_seconds"] > 0.0
    assert rows[1]["faults"] == []
    with (user_folder / "out" / "offline.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert [float(row["zeta_x"]) for row in table] == [row["zeta"][0] for row in rows]
    assert [row["value"] for row in table] == ["", str(rows[1]["value"])]
    assert [row["faults"] for row in table] == ["; ".join(row["faults"]) for row in rows]
    assert [row["costate_z_dot"] for row in table] == ["", str(rows[1]["costate"][8])]
    assert [row["u_control_M"] for row in table] == ["", str(rows[1]["u_control"][4])]
    again = call(capsys, *words, "--workers", "1")
    assert (again.code, again.out) == (1, answer.out)


@pytest.mark.slow
def test_ctrl_c_stops_the_workers_and_keeps_whole_records(
    user_folder: Path, started: list[Run]
) -> None:
    """As a terminal does it: the whole group is told."""
    np.save("states.npy", near_and_far(20, 2))
    run = Run("states.npy", "out", "--workers", "2")
    started.append(run)
    run.wait_for(1)
    workers = run.workers()
    assert len(workers) == 2
    os.killpg(run.process.pid, signal.SIGINT)
    answer = run.answer(timeout=20.0)
    assert answer.code == 1
    assert answer.out == ""
    assert answer.sentence().startswith("interrupted")
    assert not [number for number in workers if Path(f"/proc/{number}").exists()]
    names = [Path(name).name for name in files_in(user_folder / "out")]
    assert names
    assert all(name.startswith("optimal-") for name in names)
    for name in names:
        record = load(user_folder / "out" / name)
        assert record.attrs["value"] > 0.0
        assert record["mesh"].size == 7


@pytest.mark.slow
def test_workers_end_with_a_run_that_is_killed_alone(started: list[Run]) -> None:
    np.save("states.npy", near_and_far(20, 2))
    run = Run("states.npy", "out", "--workers", "2")
    started.append(run)
    run.wait_for(1)
    workers = run.workers()
    os.kill(run.process.pid, signal.SIGKILL)
    run.process.communicate()
    end = time.monotonic() + 15.0
    while [number for number in workers if Path(f"/proc/{number}").exists()]:
        assert time.monotonic() < end, "a worker goes on for nobody"
        time.sleep(0.05)


def test_a_second_run_into_the_same_folder_is_refused(user_folder: Path, capsys: Capture) -> None:
    (user_folder / "out").mkdir()
    with locked(user_folder / "out"):
        answer = call(capsys, "offline", "--quiet", "--out", "out", *SETTINGS)
    assert answer.code == 2
    text = answer.sentence()
    for word in ("another run", f"process {os.getpid()}", "'out'", "--out"):
        assert word in text
    assert files_in(user_folder) == []


def test_the_lock_of_a_dead_process_is_taken_over(user_folder: Path, capsys: Capture) -> None:
    (user_folder / "out").mkdir()
    (user_folder / "out" / NAME).write_text(f"{os.getpid()}\n", encoding="utf-8")
    (user_folder / "out" / ".optimal-1.nc-123-0123abcd").write_text("half", encoding="utf-8")
    answer = call(capsys, "offline", "--quiet", "--json", "--out", "out", *SETTINGS)
    assert answer.code == 0
    assert files_in(user_folder) == ["out/offline.csv", "out/offline.json", "out/optimal-1.nc"]


@pytest.mark.parametrize("number", ["0", "-3"])
def test_no_workers(number: str, capsys: Capture) -> None:
    answer = call(capsys, "offline", "--quiet", f"--workers={number}", *SETTINGS)
    assert answer.code == 2
    assert f"--workers is {number}" in answer.sentence()
