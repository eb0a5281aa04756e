"""Numbers of results by name, bit by bit beside those of another revision.

A name is a tuple: file, then variable, column or keys of a JSON object. Texts are no numbers, so
hashes, paths and messages are never compared.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped]
import numpy as np
import numpy.typing as npt

Values = npt.NDArray[Any]
Name = tuple[str, ...]
Numbers = dict[Name, Values]

# old name -> new name, of variables, attributes, columns and JSON keys
RENAMED: dict[str, str] = {}
# patterns of names that are no results: times of this machine, versions, keys, hashes, paths
EXCLUDED = (
    *("wall_seconds", "processor_seconds", "seconds", "certified_seconds", "real_time_factor"),
    *("policy_microseconds", "policy_microseconds_mean", "policy_mean"),
    *("*_version", "format", "machine"),
    *("key", "sweep_key", "cache_hit", "resumed"),
    *("record", "table", "csv", "figures", "report", "animation"),
)
KINDS = {".nc": "netCDF", ".csv": "CSV", ".json": "JSON"}
NUMERIC = "fiub"  # kinds of numpy's types
DIMENSION = b"This is a netCDF dimension but not a netCDF variable"
WORDS = {"": np.nan, "True": 1.0, "False": 0.0}  # cells of a table


@dataclass(frozen=True)
class Difference:
    """How far numbers are from those of the same name.

    Attributes
    ----------
    compared, differing : how many numbers
    largest : relative difference, |a - b| / max(|a|, |b|); infinite where one of them is not finite,
        or where the shapes differ, which counts as a difference of every number
    where : the name where that is
    only_old, only_new : names that the other does not have
    """

    compared: int
    differing: int
    largest: float
    where: str
    only_old: list[str]
    only_new: list[str]


def compare(
    old: Mapping[Name, Values],
    new: Mapping[Name, Values],
    renamed: Mapping[str, str] = RENAMED,
    excluded: Sequence[str] = EXCLUDED,
) -> Difference:
    """Compare numbers bit by bit; NaN equals NaN, and 0 is not -0."""
    before = {tuple(renamed.get(part, part) for part in name): values for name, values in old.items()}
    before = {name: values for name, values in before.items() if not is_excluded(name, excluded)}
    after = {name: values for name, values in new.items() if not is_excluded(name, excluded)}
    compared = differing = 0
    largest, where = 0.0, ""
    for name in (name for name in before if name in after):
        a, b = before[name], after[name]
        compared += max(a.size, b.size)
        number, relative = (max(a.size, b.size), np.inf) if a.shape != b.shape else distance(a, b)
        differing += number
        if number and (not where or relative > largest):
            largest, where = relative, told(name)
    return Difference(
        compared, differing, largest, where, only_in(before, after), only_in(after, before)
    )


def is_excluded(name: Name, excluded: Sequence[str] = EXCLUDED) -> bool:
    """Return whether a part of a name fits one of the patterns."""
    return any(fnmatchcase(part, pattern) for part in name for pattern in excluded)


def distance(old: Values, new: Values) -> tuple[int, float]:
    """Return how many numbers differ, and the largest relative difference; of equal shapes."""
    a, b = (np.array(values, dtype=np.float64, ndmin=1) for values in (old, new))
    different = (a.view(np.int64) != b.view(np.int64)) & ~(np.isnan(a) & np.isnan(b))
    if not different.any():
        return 0, 0.0
    a, b = a[different], b[different]
    with np.errstate(all="ignore"):
        size = np.maximum(np.abs(a), np.abs(b))
        relative = np.where(size > 0.0, np.abs(a - b) / size, 0.0)
    relative[~(np.isfinite(a) & np.isfinite(b))] = np.inf
    return int(different.sum()), float(relative.max())


def only_in(some: Mapping[Name, Values], others: Mapping[Name, Values]) -> list[str]:
    """Return the names that only `some` have; of a file that the others lack, the file alone."""
    known = {name[0] for name in others}
    missing = [name for name in some if name not in others]
    gone = dict.fromkeys(name[0] for name in missing if name[0] not in known)
    files: dict[Name, list[str]] = {}
    for file, *entry in (name for name in missing if name[0] in known):
        files.setdefault(tuple(entry), []).append(file)
    return [*gone] + [
        f"{'.'.join(entry)} in {len(those)} files" if len(those) > 1 else told((those[0], *entry))
        for entry, those in files.items()
    ]


def told(name: Name) -> str:
    """Return a name as text."""
    return ": ".join((name[0], ".".join(name[1:]))) if len(name) > 1 else name[0]


def read(path: Path, label: str) -> Numbers:
    """Return the numbers of a netCDF, CSV or JSON file, named below `label`."""
    readers = {".nc": _record, ".csv": _table, ".json": _answer}
    return {(label, *name): values for name, values in readers[path.suffix](path)}


def _record(path: Path) -> Iterator[tuple[Name, Values]]:
    """Yield variables and attributes as they are stored."""
    with h5py.File(path) as file:
        for name, variable in file.items():
            only_dimension = variable.attrs.get("NAME", b"").startswith(DIMENSION)
            if variable.dtype.kind in NUMERIC and not only_dimension:
                yield (name,), np.asarray(variable)
        for name, value in file.attrs.items():
            if np.asarray(value).dtype.kind in NUMERIC and not name.startswith("_"):  # netCDF's own
                yield ("attributes", name), np.asarray(value)


def _table(path: Path) -> Iterator[tuple[Name, Values]]:
    """Yield the columns whose cells are numbers, True, False or empty, but not all of them empty."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for column in rows[0] if rows else ():
        cells = [row[column] for row in rows]
        try:
            values = np.array([WORDS[cell] if cell in WORDS else float(cell) for cell in cells])
        except ValueError:
            continue
        if any(cells):
            yield (column,), values


def _answer(path: Path) -> Iterator[tuple[Name, Values]]:
    text = path.read_text(encoding="utf-8")
    yield from _entries(json.loads(text), ()) if text.strip() else ()


def _entries(value: Any, name: Name) -> Iterator[tuple[Name, Values]]:
    """Yield numbers, truth values and nulls (as NaN) of a JSON value; a list of them is one entry."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _entries(item, (*name, key))
    elif isinstance(value, list) and not all(_is_number(item) for item in value):
        for label, item in zip(_labels(value), value, strict=True):
            yield from _entries(item, (*name, label))
    elif value != [] and (isinstance(value, list) or _is_number(value)):
        yield name, np.array(value, dtype=np.float64)


def _is_number(value: Any) -> bool:
    return value is None or isinstance(value, (bool, int, float))


def _labels(items: list[Any]) -> list[str]:
    """Return the names of the items if each has its own, else their numbers."""
    names = [item.get("name") if isinstance(item, dict) else None for item in items]
    if all(isinstance(name, str) for name in names) and len(set(names)) == len(names):
        return [str(name) for name in names]
    return [str(i) for i in range(len(items))]
