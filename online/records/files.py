"""netCDF and text files: written whole under a temporary name and renamed."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from ...symbolic import InputError
from ...symbolic.compiled import is_gone

if TYPE_CHECKING:
    import xarray as xr

_TEMPORARY = re.compile(r"-(\d+)-[0-9a-f]{8}$")  # what `written_whole` writes to: process and chance


def versions() -> dict[str, str]:
    """Return the versions that numbers depend on."""
    packages = ("stationkeep", "casadi", "numpy", "scipy")
    return {f"{package}_version": version(package) for package in packages}


def save(dataset: xr.Dataset, path: str | Path) -> Path:
    """Write a record as netCDF under a temporary name, then rename it.

    Raises
    ------
    InputError
        If the folder can't be written.
    """
    path = Path(path)
    content = dataset.to_netcdf(engine="h5netcdf")  # in memory: HDF5 does not survive a full disk
    with written_whole(path) as temporary:
        temporary.write_bytes(content)
    return path


def writable_folder(folder: Path) -> Path:
    """Return a folder, made where it is not there, once it is sure that files can be written in it.

    Raises
    ------
    InputError
        If they can't.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            remove_abandoned(folder)
            return folder
    except OSError as error:
        raise InputError(
            f"the folder '{folder}' can't be written ({error.strerror}); choose another one with --out"
        ) from None


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`, and rename it to `path` when the block succeeds.

    Raises
    ------
    InputError
        If the folder can't be made or written (unwritable, full).
    """
    temporary = path.with_name(f".{path.name}-{os.getpid()}-{uuid.uuid4().hex[:8]}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"'{path}' can't be written ({reason}); choose another folder with --out"
        ) from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def remove_temporaries(folder: Path, pattern: str) -> None:
    """Remove what killed runs left of files like `pattern`; nobody may be writing one."""
    for path in folder.glob(f".{pattern}-*-*"):
        if _TEMPORARY.search(path.name):
            with contextlib.suppress(OSError):
                path.unlink()


def remove_abandoned(folder: Path) -> None:
    """Remove what runs of this machine that are no more left in a folder, and in those in it."""
    for path in (*folder.glob(".*-*-*"), *folder.glob("*/.*-*-*")):
        match = _TEMPORARY.search(path.name)
        if match is not None and is_gone(int(match[1])):
            with contextlib.suppress(OSError):
                path.unlink()


def write_text(path: Path, text: str) -> Path:
    """Write a text file under a temporary name, then rename it; raises as `written_whole`."""
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path
