"""One run a folder: a lock that the system releases when its process ends, however it ends."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ...symbolic import InputError

NAME = ".stationkeep-lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, a file with this process's number in it.

    A file that a dead process left is taken over: what counts is the system's lock on it.

    Raises
    ------
    InputError
        If another run holds it, or the folder can't be locked.
    """
    path = folder / NAME
    handle = _locked_file(folder, path)
    try:
        with suppress(OSError):  # the number is for the message only
            os.ftruncate(handle, 0)
            os.write(handle, f"{os.getpid()}\n".encode())
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(handle)


def _locked_file(folder: Path, path: Path) -> int:
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise InputError(f"'{path}' can't be written ({error.strerror})") from None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is(handle, path):
                return handle
            os.close(handle)  # its holder has removed it just now
        except OSError as error:
            holder = os.pread(handle, 20, 0).decode(errors="replace").strip()
            os.close(handle)
            if isinstance(error, BlockingIOError):
                raise InputError(
                    f"another run (process {holder or 'unknown'}) is writing to '{folder}'; wait for "
                    "it or choose another folder with --out"
                ) from None
            raise InputError(f"'{path}' can't be locked ({error.strerror})") from None


def _is(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
