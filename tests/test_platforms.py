"""Other platforms: all is imported, locked and run in workers with what only POSIX has hidden."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .commands import run
from .sweeps import SETTINGS, table
from .test_architecture import ROOT, SOURCES

HERE = Path(__file__).parent
# where the existence of a file is the lock, that of a process that lives counts, whoever wrote it
LIVING = "test_cli_many_states.py::test_the_lock_of_a_dead_process_is_taken_over"
IMPORTS = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
from stationkeep.comparison.parallel import lock, pool
assert not hasattr(pool.signal, "SIGKILL") and not hasattr(lock.os, "O_NOFOLLOW")
assert pool.default_workers() == lock.os.cpu_count()
print(len([name for name in sys.modules if name.startswith("stationkeep.")]))
"""


@pytest.fixture
def elsewhere(tmp_path: Path) -> dict[str, str]:
    """Return the environment of a process for which this platform has nothing of POSIX."""
    folder = tmp_path / "site"
    folder.mkdir()
    shutil.copy(HERE / "without_posix.py", folder / "sitecustomize.py")
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)}


def assert_pass(names: list[str], only: str, env: dict[str, str]) -> None:
    """Run tests of this suite in a process of their own."""
    words = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", only]
    environment = {k: v for k, v in env.items() if not k.startswith("PYTEST_")}
    done = subprocess.run(
        [*words, f"--deselect=tests/{LIVING}", *(str(HERE / name) for name in names)],
        cwd=HERE.parent,
        env=environment,
        capture_output=True,
        text=True,
        timeout=1200,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "passed" in done.stdout


@pytest.mark.slow
def test_every_module_is_imported(elsewhere: dict[str, str], tmp_path: Path) -> None:
    names = [
        ".".join(["stationkeep", *path.relative_to(ROOT).with_suffix("").parts]) for path in SOURCES
    ]
    words = [sys.executable, "-W", "error::UserWarning", "-c", IMPORTS]
    words += [name.removesuffix(".__init__") for name in names]
    done = subprocess.run(words, cwd=tmp_path, env=elsewhere, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert int(done.stdout) == len(SOURCES)


@pytest.mark.slow
def test_locks(elsewhere: dict[str, str]) -> None:
    """One holder, known by its number; a dead one is followed; nothing but a lock is touched."""
    assert_pass(["test_comparison_lock.py"], "slow or not slow", elsewhere)


@pytest.mark.slow
def test_workers_kills_and_ctrl_c(elsewhere: dict[str, str]) -> None:
    names = ["test_comparison_pool.py", "test_main_guard.py", "test_cli_interrupt.py"]
    names += ["test_cli_many_states.py", "test_cli_sweep_faults.py"]
    assert_pass(names, "slow or not slow", elsewhere)


@pytest.mark.slow
def test_the_same_numbers(elsewhere: dict[str, str], tmp_path: Path) -> None:
    words = ("sweep", "--quiet", "--states", "2", "--workers", "2", *SETTINGS)
    for name, env in (("here", dict(os.environ)), ("there", elsewhere)):
        answer = run(*words, "--out", name, cwd=tmp_path, env=env)
        assert (answer.code, answer.err) == (0, "")
    assert len(table(tmp_path / "here")) == 4
    assert table(tmp_path / "here") == table(tmp_path / "there")
