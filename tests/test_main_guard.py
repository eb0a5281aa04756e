"""Scripts without main guard: one sentence that names it, at once, and nothing from the workers."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

GUARD = 'if __name__ == "__main__":'
TASKS = """
from stationkeep.comparison.parallel import run_tasks

def setup(shipment):
    return lambda task: iter([task])

print("told", [*run_tasks(setup, None, [1, 2, 3], 2)])
"""
SWEEP = """
from stationkeep import sweep

print("told", sweep("bluerov2-heavy", "out", policies=["lqr"], states=3, workers=2).runs)
"""
COMPARE = """
from stationkeep import Scenario, compare

scenario = Scenario.load("bluerov2-heavy", ["simulation.duration=2", "samples.number=50"])
print("told", compare(scenario, states=1, out="out", workers=2).n_states)
"""


def ended(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    (folder / "mine.py").write_text(text, encoding="utf-8")
    words = [sys.executable, "mine.py"]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize(
    "text",
    [TASKS, SWEEP, pytest.param(COMPARE, marks=pytest.mark.slow)],
    ids=["tasks", "sweep", "compare"],
)
def test_the_guard_is_named(text: str, tmp_path: Path) -> None:
    done = ended(text, tmp_path)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("Traceback") == 1, "a worker told something, too"
    last = done.stderr.splitlines()[-1]
    assert "InputError: every worker process runs 'mine.py' again" in last
    assert GUARD in last


@pytest.mark.slow
def test_below_the_guard_it_runs(tmp_path: Path) -> None:
    text = TASKS.replace("print(", f"{GUARD}\n    print(")
    done = ended(text, tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("told [Event(task=")


@pytest.mark.slow
def test_one_worker_needs_no_guard(tmp_path: Path) -> None:
    done = ended(TASKS.replace("3], 2)", "3], 1)"), tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("Event(") == 3


@pytest.mark.slow
def test_processes_of_the_user_are_told_too(tmp_path: Path) -> None:
    """Not started by this package, so that it is an error there and no silent end."""
    spawned = (
        "import multiprocessing\nfrom stationkeep.comparison.parallel import run_tasks\n"
        "context = multiprocessing.get_context('spawn')\n"
        "if multiprocessing.current_process().name != 'MainProcess':\n"
        "    [*run_tasks(int, None, [1, 2], 2)]\n"
        "process = context.Process(target=int)\nprocess.start()\nprocess.join()\n"
        "print(process.exitcode)\n"
    )
    done = ended(spawned, tmp_path)
    assert done.stdout == "1\n"
    assert GUARD in done.stderr.splitlines()[-1]
