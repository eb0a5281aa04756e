"""`stationkeep check`: the paper's assumptions and conditions with their numbers."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from ..comparison import check
from ..comparison.ideal import load_bounds
from .output import load_scenario, output_folder, print_json, print_table, progress, write_json


def run(options: argparse.Namespace) -> int:
    """Print every condition with its value for the scenario."""
    scenario = load_scenario(options)
    path = options.ideal_weights
    bounds = None if path is None else load_bounds(scenario, path)
    with progress(options) as tell:
        tell("conditions", 0.0)
        conditions = check(scenario, bounds)
    answer = {"conditions": [asdict(condition) for condition in conditions]}
    if options.out is not None:
        write_json(output_folder(options) / "conditions.json", answer)
    if options.json:
        print_json(answer)
        return 0
    words = {True: "yes", False: "no", None: "not known"}
    print_table(
        f"The paper's conditions for '{options.scenario}'",
        ["condition", "paper", "value", "bound", "holds", "note"],
        [
            [
                c.name,
                c.paper,
                "–" if c.value is None else f"{c.value:.4g}",
                "–" if c.bound is None else f"{c.bound:.4g}",
                words[c.holds],
                c.note,
            ]
            for c in conditions
        ],
    )
    return 0
