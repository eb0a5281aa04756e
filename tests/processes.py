"""A command in a process group of its own, which can be killed as a whole."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

from .commands import Answer


class Group:
    """A command that was started; subclasses tell how far it is.

    Attributes
    ----------
    folder : of its results
    process : the command's own
    """

    def __init__(self, words: list[str], folder: Path) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            words,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            start_new_session=True,
        )

    def finished(self) -> int:
        """Return how much is finished."""
        raise NotImplementedError

    def wait_for(self, count: int, timeout: float = 90.0) -> None:
        """Wait until that much is finished; the command must not have ended by then."""
        end = time.monotonic() + timeout
        while self.finished() < count:
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end
            time.sleep(0.01)

    def workers(self) -> list[int]:
        """Return the process numbers of the workers."""
        found = []
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                parent = int(path.read_text().rpartition(")")[2].split()[1])
                command = (path.parent / "cmdline").read_bytes()
            except (OSError, IndexError):
                continue
            if parent == self.process.pid and b"spawn_main" in command:
                found.append(int(path.parent.name))
        return found

    def kill(self) -> None:
        """Kill everything at once, as a machine that is switched off does."""
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.communicate()

    def answer(self, timeout: float = 240.0) -> Answer:
        """Wait for the end."""
        out, err = self.process.communicate(timeout=timeout)
        return Answer(self.process.returncode, out, err)
