"""A record is data: its file is read by itself, and nothing that lies elsewhere is opened or loaded.

netCDF files are HDF5 files, which may point to other files (external and soft links, external storage,
virtual datasets) and name filters that are loaded as code. A record has none of them. Sizes are
summed before anything is read, so that a small file can't ask for more memory than there is.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py  # type: ignore[import-untyped]
import numpy as np

from ...symbolic import InputError
from ...symbolic.arrays import Array

if TYPE_CHECKING:
    import xarray as xr

LARGEST = 2**31  # bytes of all variables together; an hour at 50 Hz has 10^8
FILTERS = {1, 2, 3}  # deflate, shuffle, fletcher32: built into HDF5
# what netCDF keeps for itself
OWN = {"CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "_FillValue", "dtype"}
# what h5py makes of a file that is no record or was damaged
FAULTS = (OSError, ArithmeticError, LookupError, RuntimeError, TypeError, ValueError, MemoryError)


def load(path: str | Path) -> xr.Dataset:
    """Read a record into memory.

    Raises
    ------
    InputError
        If the file is missing, truncated, no record, too large, or points out of itself.
    """
    import xarray as xr  # takes longer to load than all of ours

    with _opened(path) as file:
        found = dict(_variables(file))
        variables = {name: _variable(file, name, data) for name, data in found.items()}
        data = {name: one for name, one in variables.items() if one is not None}
        coordinates = {name: data.pop(name) for name in [*data] if data[name][0] == (name,)}
        return xr.Dataset(data, coordinates, _attributes(file))


def read_parts(path: str | Path, *names: str) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read a record's attributes and the variables named alone.

    Raises
    ------
    InputError
        As `load`, or if the record has no such variables.
    """
    with _opened(path) as file:
        found = dict(_variables(file))
        return _attributes(file), {name: np.asarray(found[name]) for name in names}


@contextmanager
def _opened(path: str | Path) -> Iterator[Any]:
    """Yield an open record; whatever comes up while it is read becomes one sentence."""
    if not Path(path).is_file():
        raise InputError(f"there is no record '{path}'; give the path of a netCDF file of a run")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except _ForeignError as fault:
        raise InputError(f"'{path}' is not read as a record: {fault}") from None
    except FAULTS:
        raise InputError(
            f"'{path}' can't be read as a record; it may be truncated, make it again"
        ) from None


class _ForeignError(Exception):
    """The file is none that a run writes; the message says why."""


def _variables(file: Any) -> Iterator[tuple[str, Any]]:
    """Yield the datasets of a file that lies wholly in itself; raises _ForeignError."""
    total = 0
    for name in file:
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise _ForeignError(f"'{name}' is a link, but a record holds its data itself")
        data = file[name]
        if not isinstance(data, h5py.Dataset):
            raise _ForeignError(f"'{name}' is no variable, but a record has nothing else")
        if data.is_virtual or data.external:
            raise _ForeignError(f"the data of '{name}' lie in another file, but a record holds its own")
        created = data.id.get_create_plist()
        if not {created.get_filter(i)[0] for i in range(created.get_nfilters())} <= FILTERS:
            raise _ForeignError(f"'{name}' needs a filter that is no part of HDF5")
        name.encode()
        total += int(np.prod(data.shape, dtype=float)) * data.dtype.itemsize
        if total > LARGEST:
            raise _ForeignError(f"its variables take more than {LARGEST / 2**30:g} GiB")
        yield name, data


def _variable(file: Any, name: str, data: Any) -> tuple[tuple[str, ...], Array, dict[str, Any]] | None:
    """Return dimensions, values and attributes of a variable; None for a dimension without values."""
    own = data.attrs
    if own.get("CLASS") == b"DIMENSION_SCALE":
        if own["NAME"].startswith(b"This is a netCDF dimension but not a netCDF variable"):
            return None
        dimensions: tuple[str, ...] = (name,) * data.ndim
    else:
        lists = own["DIMENSION_LIST"] if data.ndim else []
        dimensions = tuple(file[one[0]].name.removeprefix("/") for one in lists)
    text = h5py.check_string_dtype(data.dtype) is not None
    values = np.array(data.asstr()[...], dtype=str) if text else np.asarray(data)
    if own.get("dtype") == "bool":
        values = values.astype(bool)
    return dimensions, values, _attributes(data)


def _attributes(holder: Any) -> dict[str, Any]:
    """Return the attributes as Python's own types, without netCDF's."""
    found = {
        name: np.asarray(value)
        for name, value in holder.attrs.items()
        if name not in OWN and not name.startswith("_N")
    }
    for name, value in found.items():  # in a damaged file they are no Unicode, and no tool writes them
        f"{name}{value if value.dtype.kind in 'OU' else ''}".encode()
    return {name: value.item() if value.size == 1 else value for name, value in found.items()}
