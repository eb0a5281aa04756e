"""`stationkeep generate`: write, compile and verify the model functions."""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict
from pathlib import Path

from ...online.records import write_text
from ...symbolic import Export, Model, ValueFunctions
from ...symbolic.compiled import cache_folder
from ..output import load_scenario, output_folder, print_json, print_table, progress


def run(options: argparse.Namespace) -> int:
    """Build every function of the scenario and print what became of it."""
    started = time.perf_counter()
    scenario = load_scenario(options)
    station = scenario.station_keeping()
    compiled = not options.virtual_machine
    model = Model(station.model.vehicle, scenario.current, compiled=compiled)
    functions = ValueFunctions(station.problem, station.basis, compiled=compiled)
    exports: list[Export] = []
    n_samples = max(scenario.samples.number, 1)
    with progress(options) as tell:
        for described in (*model.exports(), *functions.exports(n_samples)):
            exports.append(described)
            tell("functions", len(exports) / 11)
    if options.out is not None:
        _copy_sources(exports, output_folder(options))
    seconds = time.perf_counter() - started
    cache_hit = all(described.cache_hit for described in exports)
    if options.json:
        rows = [asdict(described) for described in exports]
        print_json({"functions": rows, "cache_hit": cache_hit, "seconds": seconds})
        return 0
    print_table(
        f"Functions of {station.model.vehicle.name}, basis '{scenario.basis.name}'",
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
            for described in exports
        ],
    )
    print(f"{seconds:.1f} s; cache: {cache_folder()}")
    return 0


def _copy_sources(exports: list[Export], folder: Path) -> None:
    """Write the C code of every compiled function to `folder`."""
    for described in exports:
        if described.key is not None:
            source = cache_folder() / described.key / "function.c"
            write_text(folder / f"{described.name}.c", source.read_text(encoding="utf-8"))
