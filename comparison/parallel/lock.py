"""One run a folder: a lock that the system releases when its process ends, however it ends.

Where files can be locked (POSIX, Windows) the system's lock on an open file counts. Elsewhere the
file's existence is the lock, and that of a dead process is taken over. Only a lock is ever emptied or
removed: a link is not followed, and a file that holds something else stays as it is.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ...symbolic import InputError
from .guard import refuse_in_worker

NAME = ".stationkeep-lock"
# the number of a process; where existence is the lock, its host and its start as well
_LOCK = re.compile(rb"\s*(\d+(\s+\S+(\s+\d+)?)?\s*)?")
_LONGEST = 1024  # bytes of a lock
# what a platform has of these: no link is followed, no pipe waited for
_FLAGS = os.O_RDWR | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
_CANNOT = {errno.ENOSYS, errno.EOPNOTSUPP}  # of a platform or a file system that locks no files
_PATIENCE = 0.2  # s in which the lock of a dead process is taken over


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, which is made; a file with this process's number in it.

    A file that a dead process left is taken over: what counts is the system's lock on it.

    Raises
    ------
    InputError
        If another run holds it, the folder can't be locked, or something else has the lock's name.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = _locked_file(path)
    except OSError as error:
        raise InputError(f"'{path}' can't be written ({error.strerror})") from None
    if handle is None:
        with _existing(path):
            yield
        return
    try:
        with suppress(OSError):  # the number is for the message only
            os.ftruncate(handle, 0)
            os.lseek(handle, 0, os.SEEK_SET)
            # behind the first byte, which nobody else can read on Windows while it is locked
            os.write(handle, f" {os.getpid()}\n".encode())
        yield
    finally:
        _release(handle, path)


def _locked_file(path: Path) -> int | None:
    """Return the open file that is now locked, or None where files can't be locked."""
    while True:
        handle, is_new = _open(path)
        try:
            if not _try_to_lock(handle):
                raise _held(path, _holder(handle))
            if _is(handle, path):
                return handle
            os.close(handle)  # its holder has removed it just now
        except InputError:
            os.close(handle)
            raise
        except OSError as error:
            os.close(handle)
            if error.errno not in _CANNOT:
                raise InputError(f"'{path}' can't be locked ({error.strerror})") from None
            if is_new:
                path.unlink(missing_ok=True)
            return None


def _open(path: Path) -> tuple[int, bool]:
    """Return the open file, new or a lock that is there, and whether it is new."""
    while True:
        with suppress(FileExistsError):
            return os.open(path, _FLAGS | os.O_CREAT | os.O_EXCL, 0o644), True
        if path.is_symlink():
            raise _foreign(path, "a link")
        try:
            handle = os.open(path, _FLAGS)
        except FileNotFoundError:
            continue  # its holder has removed it just now
        fault = _fault(handle)
        if fault is None:
            return handle, False
        os.close(handle)
        raise _foreign(path, fault)


def _fault(handle: int) -> str | None:
    """Return what an open file is if it is no lock, or None."""
    described = os.fstat(handle)
    if not stat.S_ISREG(described.st_mode):
        return "a pipe or a device"
    if described.st_nlink > 1:
        return "a link"
    if described.st_size > _LONGEST or not _LOCK.fullmatch(_read(handle)):
        return "a file of something else"
    return None


def _read(handle: int) -> bytes:
    """Return the content; without its first byte where a holder lets nobody read that."""
    for start in (0, 1):
        with suppress(OSError):
            os.lseek(handle, start, os.SEEK_SET)
            return os.read(handle, _LONGEST)
    return b""


def _holder(handle: int) -> str:
    """Return the number of the process in a lock, or nothing."""
    words = _read(handle).split()
    return words[0].decode(errors="replace") if words else ""


def _try_to_lock(handle: int) -> bool:
    """Lock an open file unless somebody else has; raises OSError where files can't be locked."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says what it can't do on a platform
        from filelock import lock_descriptor  # not before it is needed: it takes a while
    return lock_descriptor(handle, blocking=False)


@contextmanager
def _existing(path: Path) -> Iterator[None]:
    """Hold a lock that is the existence of its file."""
    from filelock import SoftFileLock, Timeout

    lock = SoftFileLock(path, timeout=_PATIENCE, poll_interval=_PATIENCE / 10)
    try:
        lock.acquire()
    except Timeout:
        raise _held(path, str(lock.pid or "")) from None
    except OSError as error:
        raise InputError(f"'{path}' can't be written ({error.strerror})") from None
    try:
        yield
    finally:
        lock.release()


def _release(handle: int, path: Path) -> None:
    with suppress(OSError):
        if _is(handle, path):
            path.unlink()
    os.close(handle)
    if os.name == "nt":  # which removes no file that is open, ours or that of who holds it by now
        with suppress(OSError):
            path.unlink()


def _is(handle: int, path: Path) -> bool:
    """Return whether a path is still that of an open file, and no link to it."""
    try:
        return os.path.samestat(os.fstat(handle), path.lstat())
    except FileNotFoundError:
        return False


def _held(path: Path, holder: str) -> InputError:
    refuse_in_worker()
    return InputError(
        f"another run (process {holder or 'unknown'}) is writing to '{path.parent}'; wait for it or "
        "choose another folder with --out"
    )


def _foreign(path: Path, what: str) -> InputError:
    return InputError(f"'{path}' is {what} and no lock; remove it, or choose another folder with --out")
