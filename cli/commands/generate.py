"""`stationkeep generate`: write, compile and verify the model functions."""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict

from ...comparison import generate
from ...symbolic.compiled import cache_folder
from ..output import load_scenario, output_folder, print_json, print_table, progress

EXPECTED = 15  # functions of a vehicle


def run(options: argparse.Namespace) -> int:
    """Build every function of the scenario and print what became of it."""
    started = time.perf_counter()
    scenario = load_scenario(options)
    with progress(options) as tell:
        made = generate(
            scenario,
            None if options.out is None else output_folder(options),
            compiled=not options.virtual_machine,
            progress=lambda done: tell("functions", min(done / EXPECTED, 1.0)),
        )
    seconds = time.perf_counter() - started
    if options.json:
        rows = [asdict(described) for described in made.functions]
        print_json({"functions": rows, "cache_hit": made.cache_hit, "seconds": seconds})
        return 0
    print_table(
        f"Functions of {scenario.setup().problem.name}, basis '{scenario.basis.name}'",
        ["function", "inputs", "outputs", "operations", "compiled", "from cache", "max difference"],
        [
            [
                described.name,
                " ".join(described.inputs),
                " ".join(described.outputs),
                f"{described.operations}",
                "yes" if described.compiled else "no",
                "yes" if described.cache_hit else "no",
                f"{described.max_difference:.1e}",
            ]
            for described in made.functions
        ],
    )
    print(f"{seconds:.1f} s; cache: {cache_folder()}")
    return 0
