"""`stationkeep sweep`: many closed-loop runs, on this machine or a cluster, into one table."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...comparison import Scenario, sweep
from ...comparison.merit import QUANTILES
from ...symbolic import InputError
from ...symbolic.arrays import Array
from ..output import load_scenario, output_folder, print_json, print_table, progress
from ..solving import Rate, n_workers
from ..states import read_states

SHOWN = 60  # groups in the printed summary


def run(options: argparse.Namespace) -> int:
    """Make the runs that are missing, write journal, records and tables, and print the summary."""
    _require_numbers(options)
    scenario = load_scenario(options)
    if options.out is None:
        options.out = Path("results") / Path(options.scenario).stem / "sweep"
    scales = [] if options.scales is None else [f"envelope.scale={options.scales}"]
    with progress(options) as tell:
        rates: dict[str, Rate] = {}

        def told(stage: str, done: int, made: int, of: int) -> None:
            rates.setdefault(stage, Rate(tell, stage, of))(done, made)

        swept = sweep(
            scenario,
            output_folder(options),
            policies=[name.strip() for name in options.policies.split(",")],
            states=_states(options, scenario),
            vary=[*scales, *options.vary],
            samples=options.samples or 0,
            sampling=options.sampling,
            seed=options.seed,
            workers=options.workers,
            cluster=options.cluster,
            records=options.records,
            every=options.every,
            progress=told,
        )
    answer = asdict(swept)
    if options.json:
        print_json(answer)
    else:
        _print(answer, scenario)
    return 1 if swept.failed or swept.faults else 0


def _require_numbers(options: argparse.Namespace) -> None:
    """Refuse counts and times that are out of bounds, before anything is done."""
    n_workers(options)
    if options.samples is not None and options.samples < 1:
        raise InputError(f"--samples is {options.samples}, but must be at least 1")
    if not 0.0 <= options.every < float("inf"):
        raise InputError(f"--every is {options.every:g}, but must be zero or more seconds")
    if options.seed is not None and options.seed < 0:
        raise InputError(f"--seed is {options.seed}, but must not be negative")


def _states(options: argparse.Namespace, scenario: Scenario) -> Array | int:
    text = options.states
    if text is None:
        return 0
    try:
        number = int(text)
    except ValueError:
        return np.array(read_states(Path(text), scenario.setup().problem))
    if number < 1:
        raise InputError(f"--states is {number}, but must be at least 1")
    return number


def _print(answer: dict[str, Any], scenario: Scenario) -> None:
    groups = answer["summary"]
    settings = list(groups[0]["settings"])
    game = scenario.simulation.mode == "game"
    figures = ["regret: median / 90 % / max", "over linear's"] if game else []
    header = [*settings, "policy", "runs", "failed", *figures, "rms [m]", "energy [J]", "us/step"]
    rows = []
    for group in groups[:SHOWN]:
        row = [str(group["settings"][key]) for key in settings]
        row += [group["policy"], str(group["n"]), str(group["failed"])]
        if game:
            row += [
                _forms(group["regret"], 100.0, ".3f", " %"),
                _forms(group["of_linear"], 1.0, ".3f", ""),
            ]
        row += [_form(group["position_rms"], ".3f"), _form(group["energy"], ".1f")]
        rows.append([*row, _form(group["policy_mean"], ".0f")])
    print_table(
        "Sweep: regret with runs that failed as infinite, ∞; else medians of those that did not",
        header,
        rows,
    )
    if len(groups) > SHOWN:
        print(f"{len(groups) - SHOWN} more groups are in the table")
    short = sum(group["too_short"] for group in groups)
    if game and short:
        print(
            f"{short} of the runs ended with more than a thousandth of the cost still to come, counted "
            "as V* of their last state: their regret is that of the time before, raise "
            "simulation.duration"
        )
    for fault in answer["faults"]:
        print(f"wrong: {fault}")
    print(
        f"{answer['runs']} runs, {answer['failed']} failed, {answer['resumed']} were there already; "
        f"table: {answer['table']}"
    )


def _forms(values: dict[str, Any] | None, factor: float, form: str, unit: str) -> str:
    shown = [None if values is None else values[name] for name in QUANTILES]
    if all(one is None for one in shown) and not (values or {}).get("diverged"):
        return "–"
    return " / ".join("∞" if one is None else f"{factor * one:{form}}" for one in shown) + unit


def _form(value: float | None, form: str) -> str:
    return "–" if value is None else f"{value:{form}}"
