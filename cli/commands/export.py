"""`stationkeep export`: a record as a .mat file."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...comparison.adapters import export_mat
from ...online import load
from ...symbolic import InputError
from ..output import print_json


def run(options: argparse.Namespace) -> int:
    """Write the record as a .mat file and print where, and what is in it."""
    record = load(options.record)
    path: Path = options.out or options.record.with_suffix(".mat")
    if path.suffix != ".mat":
        raise InputError(f"--out is '{path}', but MATLAB loads files that end with .mat; name one so")
    names = export_mat(record, path)
    if options.json:
        print_json({"file": path, "variables": names})
    else:
        print(f"{path}: {', '.join(names)}")
    return 0
