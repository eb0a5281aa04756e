"""`stationkeep check`: the paper's assumptions and conditions with their numbers."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from ...comparison import Condition, check
from ...symbolic import InputError
from ..options import DEFAULT_SCENARIO
from ..output import load_scenario, output_folder, print_json, print_table, progress, write_json


def run(options: argparse.Namespace) -> int:
    """Print every condition with its value for the scenario, and for a run of it if one is given."""
    if options.run is not None and (options.overrides or options.scenario != DEFAULT_SCENARIO):
        raise InputError(
            "--run brings the scenario of its run along; leave out the scenario and --set, or --run"
        )
    scenario = None if options.run is not None else load_scenario(options)
    with progress(options) as tell:
        tell("conditions", 0.0)
        conditions = check(scenario, options.run, options.ideal_weights)
    answer = {"conditions": [asdict(condition) for condition in conditions]}
    if options.out is not None:
        write_json(output_folder(options) / "conditions.json", answer)
    if options.json:
        print_json(answer)
        return 0
    _print(conditions, options.scenario if options.run is None else str(options.run))
    return 0


def _print(conditions: list[Condition], name: str) -> None:
    words = {True: "yes", False: "no", None: "not known"}
    print_table(
        f"The paper's conditions for '{name}'",
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
