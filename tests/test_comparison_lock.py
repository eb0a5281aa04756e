"""The lock of a folder: one holder, known by its number, gone with its process."""

from __future__ import annotations

import os
import signal
import socket
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


def holder(folder: Path) -> int:
    """Return the number of the process in the lock of a folder."""
    return int((folder / NAME).read_text(encoding="utf-8").split()[0])


def test_one_at_a_time(tmp_path: Path, one_sentence: Check) -> None:
    with locked(tmp_path):
        assert holder(tmp_path) == os.getpid()
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
            assert holder(tmp_path) == os.getpid()
    finally:
        process.kill()
        process.communicate()
    assert not list(tmp_path.iterdir())


def test_a_folder_in_its_place(tmp_path: Path, one_sentence: Check) -> None:
    (tmp_path / NAME).mkdir()
    with pytest.raises(InputError, match=NAME) as caught, locked(tmp_path):
        pytest.fail("a folder was locked as a file")
    one_sentence(caught.value)


OTHERS = {"text": "# my notes\n", "table": "1 2 3 4\n", "long": "7\n" * 1000, "binary": "\0\1\2"}


@pytest.mark.parametrize("content", OTHERS.values(), ids=OTHERS)
def test_a_file_of_something_else_stays_as_it_is(
    content: str, tmp_path: Path, one_sentence: Check
) -> None:
    (tmp_path / NAME).write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match="no lock") as caught, locked(tmp_path):
        pytest.fail("a file of something else was taken for a lock")
    one_sentence(caught.value)
    assert (tmp_path / NAME).read_text(encoding="utf-8") == content


@pytest.mark.parametrize("make", [Path.symlink_to, Path.hardlink_to], ids=["symbolic", "hard"])
@pytest.mark.parametrize("content", ["", "123\n", "letters"])
def test_a_link_is_not_followed(
    make: Callable[[Path, Path], None], content: str, tmp_path: Path, one_sentence: Check
) -> None:
    """Not even to what looks like a lock: what it leads to stays as it is, and the link as well."""
    target, folder = tmp_path / "valuable", tmp_path / "out"
    target.write_text(content, encoding="utf-8")
    folder.mkdir()
    make(folder / NAME, target)
    with pytest.raises(InputError, match="is a link and no lock") as caught, locked(folder):
        pytest.fail("a link was followed")
    one_sentence(caught.value)
    assert target.read_text(encoding="utf-8") == content
    assert (folder / NAME).exists()


def test_a_link_to_nothing_makes_nothing(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / NAME).symlink_to(tmp_path / "new")
    with pytest.raises(InputError, match="is a link and no lock"), locked(tmp_path / "out"):
        pytest.fail("a link was followed")
    assert not (tmp_path / "new").exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / NAME)
    with pytest.raises(InputError, match="no lock"), locked(tmp_path):
        pytest.fail("a pipe was locked")


def test_what_took_its_place_stays(tmp_path: Path) -> None:
    with locked(tmp_path):
        (tmp_path / NAME).unlink()
        (tmp_path / NAME).write_text("mine", encoding="utf-8")
    assert (tmp_path / NAME).read_text(encoding="utf-8") == "mine"


def test_a_lock_of_a_dead_process_is_taken_over(tmp_path: Path) -> None:
    """Whatever way of locking it came from: with its number alone, or with host and start."""
    command = [sys.executable, "-c", "import os; print(os.getpid())"]
    number, host = int(subprocess.check_output(command)), socket.gethostname()
    for content in (f"{number}\n{host}\n", f"{number}\n{host}\n12345\n"):
        (tmp_path / NAME).write_text(content, encoding="utf-8")
        with locked(tmp_path):
            assert holder(tmp_path) == os.getpid()
        assert not list(tmp_path.iterdir())
