"""`stationkeep replay`: run a record again and say whether its numbers come out again."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from ...comparison.records import BIT_EQUAL, DIFFERENT, Replay, replay
from ...online import save
from ...symbolic import InputError
from ..output import print_json, print_table, progress

HEADER = ["variable", "difference"]


def run(options: argparse.Namespace) -> int:
    """Make the record's run again, compare, print the verdict; 1 if the numbers are others."""
    path, tolerance = options.record, options.tolerance
    if not 0.0 < tolerance < math.inf:
        raise InputError(f"--tolerance is {tolerance:g}, but must be a positive number")
    with progress(options) as tell:
        answer = replay(path, tolerance, lambda part: tell("run again", part), policy=options.policy)
    if options.out is not None:
        save(answer.record, options.out)
    if options.json:
        print_json(_answer(answer, path, tolerance))
    else:
        _print(answer, path, tolerance)
    return 1 if answer.verdict == DIFFERENT else 0


def _answer(answer: Replay, path: Path, tolerance: float) -> dict[str, Any]:
    name, time = answer.first or (None, None)
    notes = (
        {}
        if math.isfinite(answer.max_difference)
        else {"max_difference": "a text, a shape or a NaN differs"}
    )
    return {
        "verdict": answer.verdict,
        "max_difference": answer.max_difference,
        "tolerance": tolerance,
        "record": path,
        "kind": answer.kind,
        "differences": answer.differences,
        "first": {"variable": name, "time": time},
        "changed": answer.changed,
        "notes": notes,
    }


def _print(answer: Replay, path: Path, tolerance: float) -> None:
    print(f"{answer.verdict}: {path} ({answer.kind})")
    if answer.verdict == BIT_EQUAL:
        for change in answer.changed:
            print(change)
        return
    sizes = sorted(answer.differences.items(), key=lambda entry: -entry[1])
    rows = [[name, f"{size:.1e}" if size else "0"] for name, size in sizes]
    print_table(f"Differences, relative to the largest value (tolerance {tolerance:g})", HEADER, rows)
    name, time = answer.first or ("nothing", None)
    when = "" if time is None else f" at t = {time:.2f} s"
    print(f"first to differ: {name}{when}")
    print("; ".join(answer.changed) or "versions, machine and generated code are the record's own")
