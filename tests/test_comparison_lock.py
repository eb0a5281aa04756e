"""The lock of a folder: one holder, known by its number, gone with its process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from stationkeep.comparison.parallel import locked
from stationkeep.comparison.parallel.lock import NAME
from stationkeep.symbolic import InputError

Check = Callable[[BaseException], str]
HOLDER = """
import sys, time
from pathlib import Path
from stationkeep.comparison.parallel import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_one_at_a_time(tmp_path: Path, one_sentence: Check) -> None:
    with locked(tmp_path):
        assert (tmp_path / NAME).read_text(encoding="utf-8") == f"{os.getpid()}\n"
        with pytest.raises(InputError, match=f"process {os.getpid()}") as caught, locked(tmp_path):
            pytest.fail("the lock was given twice")
        one_sentence(caught.value)
        assert (tmp_path / NAME).exists(), "who is refused leaves it alone"
    assert not list(tmp_path.iterdir())
    with locked(tmp_path):
        pass


def test_the_folder_is_made(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "one"
    with locked(folder):
        assert (folder / NAME).is_file()
    assert folder.is_dir()


def test_it_is_given_back_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), locked(tmp_path):
        raise ZeroDivisionError
    with locked(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_killed_holder_is_followed(tmp_path: Path) -> None:
    """Refused while it lives, taken over when it is dead, though its file is still there."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=f"process {process.pid}"), locked(tmp_path):
            pytest.fail("the lock was given twice")
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert (tmp_path / NAME).exists()
        with locked(tmp_path):
            assert (tmp_path / NAME).read_text(encoding="utf-8") == f"{os.getpid()}\n"
    finally:
        process.kill()
        process.communicate()
    assert not list(tmp_path.iterdir())


def test_a_folder_in_its_place(tmp_path: Path, one_sentence: Check) -> None:
    (tmp_path / NAME).mkdir()
    with pytest.raises(InputError, match=NAME) as caught, locked(tmp_path):
        pytest.fail("a folder was locked as a file")
    one_sentence(caught.value)
