"""`stationkeep check`: the paper's assumptions and conditions with their numbers."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

import xarray as xr

from ...comparison import Condition, Scenario, check
from ...comparison.optima import load_ideal
from ...comparison.theory import require_run, run_conditions, theory
from ...online import load
from ...symbolic import InputError
from ...symbolic.toml import validate
from ..options import DEFAULT_SCENARIO
from ..output import load_scenario, output_folder, print_json, print_table, progress, write_json


def run(options: argparse.Namespace) -> int:
    """Print every condition with its value for the scenario, and for a run of it if one is given."""
    record = None if options.run is None else _record(options)
    scenario = load_scenario(options) if record is None else _scenario_of(record, options)
    with progress(options) as tell:
        tell("conditions", 0.0)
        conditions = _conditions(scenario, record, options)
    answer = {"conditions": [asdict(condition) for condition in conditions]}
    if options.out is not None:
        write_json(output_folder(options) / "conditions.json", answer)
    if options.json:
        print_json(answer)
        return 0
    _print(conditions, options.scenario if options.run is None else str(options.run))
    return 0


def _conditions(
    scenario: Scenario, record: xr.Dataset | None, options: argparse.Namespace
) -> list[Condition]:
    path = options.ideal_weights
    ideal = None if path is None else load_ideal(scenario, path)
    bounds = None if ideal is None else ideal.bounds
    if record is None:
        return check(scenario, bounds)
    found = None if ideal is None else theory(scenario, record, ideal)
    listed = check(scenario, bounds, float(record["rank_margin"].min()))
    return listed + run_conditions(scenario, record, found)


def _record(options: argparse.Namespace) -> xr.Dataset:
    if options.overrides or options.scenario != DEFAULT_SCENARIO:
        raise InputError(
            "--run brings the scenario of its run along; leave out the scenario and --set, or --run"
        )
    record = load(options.run)
    require_run(record, str(options.run))
    return record


def _scenario_of(record: xr.Dataset, options: argparse.Namespace) -> Scenario:
    try:
        text = json.loads(str(record.attrs["scenario"]))
    except (KeyError, json.JSONDecodeError):
        raise InputError(f"'{options.run}' does not say what was run; make it again") from None
    return validate(Scenario, text, f"the scenario of '{options.run}'")


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
