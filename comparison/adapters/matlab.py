"""A record as a MATLAB file."""

from __future__ import annotations

import keyword
import re
from pathlib import Path
from typing import Any

import xarray as xr

from ...online import load
from ...online.records import written_whole
from ...symbolic import InputError

LONGEST = 63  # characters of a MATLAB name
# MATLAB's keywords that are not also Python's
RESERVED = {"case", "catch", "end", "function", "otherwise", "parfor", "persistent", "spmd", "switch"}


def export(record: Path | str, out: Path | str | None = None) -> tuple[Path, list[str]]:
    """Write the record in a file as a .mat file; return its path and the names of its variables.

    Parameters
    ----------
    record : netCDF file of a run or an optimum
    out : path that ends with .mat; beside the record if None

    Raises
    ------
    InputError
        If the record can't be read, or the file can't be written or is not to end with .mat.
    """
    dataset = load(Path(record))
    path = Path(record).with_suffix(".mat") if out is None else Path(out)
    if path.suffix != ".mat":
        raise InputError(f"--out is '{path}', but MATLAB loads files that end with .mat; name one so")
    return path, export_mat(dataset, path)


def export_mat(record: xr.Dataset, path: Path) -> list[str]:
    """Write a record as a .mat file (version 5); returns the names of its variables.

    Every variable and coordinate is an array of its own under its own name, the first dimension down
    the rows, so that `plot(time, zeta(:, 1))` draws x; names of states and forces are cell arrays.
    Three structs describe them: `units` and `dimensions` with a field for each variable, and
    `provenance` with the attributes: scenario and vehicle as JSON text (`jsondecode`), seed, versions,
    hashes, why a run ended early.

    Raises
    ------
    InputError
        If the file can't be written.
    """
    from scipy.io import savemat

    arrays = {matlab_name(str(name)): record[name] for name in record.variables}
    content: dict[str, Any] = {name: _matlab_array(array.values) for name, array in arrays.items()}
    content |= {
        "units": {name: str(array.attrs.get("units", "")) for name, array in arrays.items()},
        "dimensions": {name: " x ".join(map(str, array.dims)) for name, array in arrays.items()},
        "provenance": {matlab_name(str(name)): value for name, value in record.attrs.items()},
    }
    with written_whole(path) as temporary:
        savemat(temporary, content, appendmat=False, long_field_names=True, oned_as="column")
    return list(content)


def matlab_name(name: str) -> str:
    """Return a name that MATLAB takes: letters, digits and underscores, no keyword, a letter first."""
    valid = re.sub(r"\W", "_", name, flags=re.ASCII)
    if not valid[:1].isalpha():
        valid = f"x{valid}"
    if keyword.iskeyword(valid) or valid in RESERVED:
        valid += "_"
    return valid[:LONGEST]


def _matlab_array(values: Any) -> Any:
    """Return numbers as they are, a text as text, and texts as a cell array."""
    if values.dtype.kind in "biuf":
        return values
    return str(values) if values.ndim == 0 else values.astype(object)
