"""A record run again, and what became of its numbers: bit-equal, equal to a tolerance, or different."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...online.loop import Progress
from ...symbolic.arrays import Array
from .own_program import PLAYED, of_the_plant
from .recorded import load_run, run_again

TOLERANCE = 1e-6
BIT_EQUAL, WITHIN, DIFFERENT = "bit-equal", "within tolerance", "different"
OUTCOMES = ("stopped", "failed", "faults", "value")  # attributes that are results
CLOCKS = ("time", "learn_time", "node")


@dataclass(frozen=True)
class Replay:
    """What a record's run gave when it was made again.

    Attributes
    ----------
    kind : what the record is of
    verdict : `bit-equal`, `within tolerance` or `different`
    max_difference : largest of `differences`
    differences : of each variable and outcome, max |now - then| over its largest |then|; inf where a
        text, a shape or a NaN is another
    first : variable that leaves the tolerance first, and when [s], None where it has no time; of one
        within tolerance, what leaves bit-equality; None if nothing does
    changed : versions, compiled functions and machine that are others than the record's
    record : made now
    """

    kind: str
    verdict: str
    max_difference: float
    differences: dict[str, float]
    first: tuple[str, float | None] | None
    changed: list[str]
    record: xr.Dataset


def replay(
    path: str | Path,
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
    *,
    policy: str | None = None,
) -> Replay:
    """Make the run of a record again from what the record holds, and compare the two.

    A policy or a critic law of one's own is a program, and so no part of a record: without it the
    inputs that it gave are played back, and what the plant makes of them is compared.

    Parameters
    ----------
    tolerance : largest relative difference of numbers that still count as equal
    progress : called with the part of a closed loop that is done, 0 to 1
    policy : "file.py:make" of the run's own policy or law, which is compared by its hash and run

    Raises
    ------
    InputError
        If the file is no record, or one that this version can't run; or if `policy` is another one.
    """
    record = load_run(path)
    again = run_again(record, Path(path).parent, progress, policy)
    return compared(of_the_plant(record) if PLAYED in again.attrs else record, again, tolerance)


def compared(then: xr.Dataset, now: xr.Dataset, tolerance: float = TOLERANCE) -> Replay:
    """Compare every variable, coordinate and outcome of two records; wall times are left out."""
    gaps = {name: gap(_values(then, name), _values(now, name)) for name in _names(then, now)}
    differences = {name: float(rows.max(initial=0.0)) for name, rows in gaps.items()}
    largest = max(differences.values(), default=0.0)
    limit = tolerance if largest > tolerance else 0.0
    return Replay(
        kind=str(then.attrs["kind"]),
        verdict=BIT_EQUAL if largest == 0.0 else WITHIN if largest <= tolerance else DIFFERENT,
        max_difference=largest,
        differences=differences,
        first=_first(then, now, {name: rows > limit for name, rows in gaps.items()}),
        changed=changes(then, now),
        record=now,
    )


def gap(then: Any, now: Any) -> Array:
    """Return the difference of two arrays relative to the largest finite |then|, a row an entry.

    0 where bits are equal or both are NaN, inf where one is NaN, a text differs, a row is missing, or
    the shape of a row is another. One that is missing altogether is None.
    """
    if then is None or now is None:
        return np.array([np.inf])
    a, b = np.atleast_1d(np.asarray(then)), np.atleast_1d(np.asarray(now))
    rows = np.full(max(len(a), len(b)), np.inf)
    n = min(len(a), len(b))
    if a.shape[1:] == b.shape[1:]:
        rows[:n] = _relative(a, b, n).reshape(n, prod(a.shape[1:])).max(axis=1, initial=0.0)
    return rows


def _relative(a: Any, b: Any, n: int) -> Array:
    """Return the entries' differences in the first n rows."""
    if a.dtype.kind not in "biuf" or b.dtype.kind not in "biuf":
        return np.where(a[:n].astype(str) == b[:n].astype(str), 0.0, np.inf)
    a, b = a.astype(np.float64), b.astype(np.float64)
    scale = np.abs(a[np.isfinite(a)]).max(initial=0.0) or 1.0
    a, b = a[:n], b[:n]
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):  # infinities of one sign are the same
        difference = np.where(same, 0.0, np.abs(b - a) / scale)
    return np.where(np.isnan(difference), np.inf, difference)


def changes(then: xr.Dataset, now: xr.Dataset) -> list[str]:
    """Return which versions, compiled functions and machine differ, each as a sentence's part."""
    names = [name for name in now.attrs if name.endswith("_version")]
    found = [
        f"{name.removesuffix('_version')} was {then.attrs.get(name, 'unknown')}, is {now.attrs[name]}"
        for name in (*names, "machine")
        if then.attrs.get(name) != now.attrs[name]
    ]
    if then.attrs.get("functions") != now.attrs["functions"]:
        found.append("the generated code of f, g and the basis is another")
    if PLAYED in now.attrs:
        return [*found, str(now.attrs[PLAYED])]
    if not found and then.attrs.get("key") != now.attrs["key"]:
        found.append("the record's settings are not those that it was made with")
    return found


def _names(then: xr.Dataset, now: xr.Dataset) -> list[str]:
    """Return the variables and coordinates of either, and the outcomes."""
    names = dict.fromkeys(str(name) for record in (then, now) for name in record.variables)
    return [*names, *(name for name in OUTCOMES if name in then.attrs or name in now.attrs)]


def _values(record: xr.Dataset, name: str) -> Any:
    return record.attrs.get(name) if name in OUTCOMES else _variable(record, name)


def _variable(record: xr.Dataset, name: str) -> Any:
    return record[name].values if name in record.variables else None


def _first(then: xr.Dataset, now: xr.Dataset, over: dict[str, Any]) -> tuple[str, float | None] | None:
    """Return the variable that differs first in time, else the first that differs at all."""
    found: list[tuple[float, str, float | None]] = []
    for name, rows in over.items():
        if rows.any():
            time = _time(then, now, name, int(rows.argmax()))
            found.append((np.inf if time is None else time, name, time))
    if not found:
        return None
    _, name, time = min(found, key=lambda entry: entry[0])
    return name, time


def _time(then: xr.Dataset, now: xr.Dataset, name: str, row: int) -> float | None:
    """Return the time of a variable's row, from the record that has it."""
    for record in (then, now):
        if name in record.variables and record[name].dims and record[name].dims[0] in CLOCKS:
            times = record[record[name].dims[0]].values
            if row < len(times):
                return float(times[row])
    return None
