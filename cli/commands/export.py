"""`stationkeep export`: a record as a .mat file."""

from __future__ import annotations

import argparse

from ...comparison import export
from ..output import print_json


def run(options: argparse.Namespace) -> int:
    """Write the record as a .mat file and print where, and what is in it."""
    path, names = export(options.record, options.out)
    if options.json:
        print_json({"file": path, "variables": names})
    else:
        print(f"{path}: {', '.join(names)}")
    return 0
