"""The rows of a sweep: a journal that survives any kill, and the tables that are made from it."""

from __future__ import annotations

import csv
import json
import os
import stat
import time
import zlib
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from io import FileIO
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import h5netcdf  # type: ignore[import-untyped]
import h5py  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from ...online.records import written_whole
from ...symbolic import InputError

BLOCK = 500  # rows that are in memory at the same time
SECONDS_BETWEEN_SYNCS = 1.0


class Journal:
    """A file to which every finished run adds a line: checksum, key and row.

    A line that is not whole is left out when the journal is read again. Lines are handed to the system
    one by one, and forced to the disk every second.

    Attributes
    ----------
    broken : lines that could not be read when it was opened
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.broken = 0
        self._keys, self._offsets = array("Q"), array("q")
        self._synced = 0.0
        _require_own(path)
        try:
            self._file: BinaryIO = path.open("a+b")
            self._read()
        except OSError as error:
            raise self._unwritable(error) from None

    def offsets(self, keys: Iterable[str]) -> Iterator[int]:
        """Yield where the last line of each key is, -1 if there is none."""
        known = (
            np.frombuffer(self._keys, dtype=np.uint64) if len(self._keys) else np.zeros(0, np.uint64)
        )
        order = np.argsort(known, kind="stable")
        ordered, keys = known[order], iter(keys)
        while block := [*islice(keys, BLOCK)]:
            wanted = np.array([_short(key) for key in block], dtype=np.uint64)
            places = np.searchsorted(ordered, wanted, side="right") - 1
            for key, short, place in zip(block, wanted, places, strict=True):
                found = place >= 0 and ordered[place] == short
                offset = self._offsets[order[place]] if found else -1
                yield offset if offset >= 0 and self.at(offset)["key"] == key else -1

    def add(self, line: Mapping[str, Any]) -> int:
        """Append a line, with a `key`, and return where it is.

        Raises
        ------
        InputError
            If it can't be written; what was half written is taken back.
        """
        text = json.dumps(line).encode()
        self._file.seek(0, os.SEEK_END)
        offset = self._file.tell()
        try:
            self._file.write(b"%08x %s\n" % (zlib.crc32(text), text))
            self._file.flush()
            if time.monotonic() - self._synced > SECONDS_BETWEEN_SYNCS:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            self._file = self._reopened(offset)
            raise self._unwritable(error) from None
        return offset

    def read_again(self) -> None:
        """Find the lines anew: an interrupt may have come between a line and what is known of it."""
        self._file.flush()
        self._keys, self._offsets = array("Q"), array("q")
        self._read()

    def at(self, offset: int) -> dict[str, Any]:
        """Return the line that is there."""
        self._file.seek(offset)
        line = _parsed(self._file.readline())
        if line is None:
            raise InputError(f"'{self.path}' was changed while it was in use; run the sweep again")
        return line

    def close(self) -> None:
        """Force everything to the disk and close the file; raises as `add`."""
        try:
            with self._file:
                os.fsync(self._file.fileno())
        except OSError as error:
            raise self._unwritable(error) from None

    def _read(self) -> None:
        """Find the lines; end a torn last one, so that the next line begins on its own."""
        self._file.seek(0)
        offset, text = 0, b""
        for text in self._file:
            line = _parsed(text)
            if line is None:
                self.broken += 1
            elif not line.get("lost"):
                self._keys.append(_short(line["key"]))
                self._offsets.append(offset)
            offset += len(text)
        if text and not text.endswith(b"\n"):
            self._file.truncate(offset - len(text))

    def _reopened(self, size: int) -> BinaryIO:
        """Return the file again, without what could not be written and is still in its buffer."""
        file = self.path.open("a+b")
        os.ftruncate(file.fileno(), size)
        return file

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(
            f"'{self.path}' can't be written ({error.strerror}); what was finished is kept, make room "
            "and run the sweep again"
        )


def _require_own(path: Path) -> None:
    """Raise InputError where a path is something else than a journal, which would be changed."""
    try:
        kind = path.lstat()
    except OSError:
        return
    fault = None
    if not stat.S_ISREG(kind.st_mode):
        fault = "a link, a folder or a device"
    elif kind.st_nlink > 1:
        fault = "a link"
    elif kind.st_size:
        with suppress(OSError), path.open("rb") as file:
            head = file.read(64)
            # one byte may be changed; of a torn line there may be less
            if not (head[8:9] == b" " or head[9:10] == b"{" or len(head) < 9):
                fault = "a file of something else"
    if fault is not None:
        raise InputError(
            f"'{path}' is {fault}, but has the name of a sweep's journal; move it away, or choose "
            "another folder with --out"
        )


def _short(key: str) -> int:
    return int(key[:16], 16)


def _parsed(text: bytes) -> dict[str, Any] | None:
    """Return what a line holds, None if it is not whole."""
    checksum, _, body = text.partition(b" ")
    try:
        if not body.endswith(b"\n") or int(checksum, 16) != zlib.crc32(body[:-1]):
            return None
        line = json.loads(body)
    except ValueError:
        return None
    return line if isinstance(line, dict) else None


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> Path:
    """Write a table row by row, numbers exact, what is not known empty; raises as `written_whole`."""
    with written_whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(columns)
        for row in rows:
            table.writerow(["" if row[name] is None else _cell(row[name]) for name in columns])
    return path


def write_netcdf(
    path: Path,
    units: Mapping[str, str | None],
    n_rows: int,
    rows: Iterable[Mapping[str, Any]],
    attributes: Mapping[str, Any],
) -> Path:
    """Write a table as netCDF with the dimension `run`, a block of rows at a time.

    Parameters
    ----------
    units : of each column of numbers; None for a column of text
    n_rows : number of rows

    Raises
    ------
    InputError
        If the file can't be written.
    """
    with written_whole(path) as temporary, FileIO(temporary, "w+") as file:
        sink = _Sink(file)
        with h5netcdf.File(sink, "w") as table:
            table.dimensions = {"run": n_rows}
            table.attrs.update(attributes)
            for name, unit in units.items():
                kind = h5py.string_dtype() if unit is None else np.dtype(_kind(name))
                variable = table.create_variable(name, ("run",), kind)
                if unit is not None:
                    variable.attrs["units"] = unit
            start, rows = 0, iter(rows)
            while block := [*islice(rows, BLOCK)]:
                for name, unit in units.items():
                    cells = [row[name] for row in block]
                    table.variables[name][start : start + len(block)] = _column(name, unit, cells)
                if sink.error is not None:
                    break
                start += len(block)
        if sink.error is not None:
            raise sink.error
    return path


def _kind(name: str) -> str:
    return {"run": "i8", "state": "i8", "failed": "i1"}.get(name, "f8")


def _column(name: str, unit: str | None, cells: list[Any]) -> NDArray[Any]:
    if unit is None:
        return np.array(["" if cell is None else _cell(cell) for cell in cells], dtype=object)
    return np.array([np.nan if cell is None else cell for cell in cells], dtype=_kind(name))


def _cell(value: Any) -> Any:
    return value if isinstance(value, (int, float, str)) else json.dumps(value)


class _Sink:
    """A file that never fails while HDF5 writes to it: HDF5 does not survive a full disk.

    Attributes
    ----------
    error : the first failure, to be raised when HDF5 has closed the file
    """

    def __init__(self, file: FileIO) -> None:
        self._file = file  # without a buffer: it would fail in seek, too
        self.error: OSError | None = None
        self.seek, self.tell = file.seek, file.tell
        self.read, self.readinto = file.read, file.readinto

    def write(self, content: bytes) -> int:
        """Write, or remember why that was not possible."""
        left = memoryview(content).cast("B")
        try:
            while left and self.error is None:
                left = left[self._file.write(left) :]
        except OSError as error:
            self.error = error
        return len(content)

    def truncate(self, size: int) -> int:
        """Change the size, or remember why that was not possible."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size

    def flush(self) -> None:
        """Do nothing: nothing is held back."""
