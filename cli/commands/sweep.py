"""`stationkeep sweep`: many closed-loop runs, on this machine or a cluster, into one table."""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Sequence
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...comparison import Scenario
from ...comparison.merit import QUANTILES
from ...comparison.parallel import Event, locked, run_on_cluster, run_tasks
from ...comparison.sweep import Bench, Execute, Finished, Plan, Run, Setup, Sweep, parse_vary, summary
from ...symbolic import InputError, StationkeepError
from ...symbolic.arrays import Array
from ..output import load_scenario, output_folder, print_json, print_table, progress
from ..solving import Rate, n_workers
from ..states import read_states

SHOWN = 60  # groups in the printed summary


def run(options: argparse.Namespace) -> int:
    """Make the runs that are missing, write journal, records and tables, and print the summary."""
    execute = _executor(options)
    scenario = load_scenario(options)
    plan = _plan(options, scenario)
    bench = Bench(scenario, options.records, options.every)
    if options.out is None:
        options.out = Path("results") / Path(options.scenario).stem / "sweep"
    folder = output_folder(options)
    started = time.monotonic()
    with locked(folder), closing(Sweep(plan, bench, folder)) as sweep:
        resumed = _all_runs(options, sweep, execute)
        csv, table = sweep.write_tables()
        groups = summary(sweep.rows(), [choice.key for choice in plan.choices])
        failed = sum(group["failed"] for group in groups)
    answer: dict[str, Any] = {
        "runs": len(plan),
        "failed": failed,
        "table": table,
        "csv": csv,
        "resumed": resumed,
        "seconds": time.monotonic() - started,
        "summary": groups,
    }
    if options.json:
        print_json(answer)
    else:
        _print(answer, scenario)
    return 1 if failed else 0


def _all_runs(options: argparse.Namespace, sweep: Sweep, execute: Execute) -> int:
    """Make what is missing; whatever happens, write the tables of what is finished."""
    with progress(options) as tell:
        if sweep.journal.broken:
            tell(
                f"{sweep.journal.broken} lines of the journal can't be read; their runs are made again",
                0.0,
            )
        tell("finished runs", 0.0)
        resumed = sweep.resume(lambda seen, _: tell("finished runs", seen / len(sweep.plan)))
        tell("sweep", resumed / len(sweep.plan))
        try:
            sweep.go(execute, Rate(tell, "sweep", len(sweep.plan)))
        except (KeyboardInterrupt, StationkeepError):
            with suppress(InputError):
                sweep.write_tables()
            raise
        tell("tables", 0.0)
    return resumed


def _executor(options: argparse.Namespace) -> Execute:
    if options.cluster is not None:
        if options.workers is not None:
            raise InputError("--workers is for this machine; a cluster has workers of its own")
        return partial(run_on_cluster, options.cluster)
    number = n_workers(options)

    def here(setup: Setup, bench: Bench, runs: Sequence[Run]) -> Generator[Event[Finished], None, None]:
        return run_tasks(setup, bench, runs, number)

    return here


def _plan(options: argparse.Namespace, scenario: Scenario) -> Plan:
    asked = list(options.vary)
    if options.scales is not None:
        asked.insert(0, f"envelope.scale={options.scales}")
    if options.samples is not None and options.samples < 1:
        raise InputError(f"--samples is {options.samples}, but must be at least 1")
    if not 0.0 <= options.every < float("inf"):
        raise InputError(f"--every is {options.every:g}, but must be zero or more seconds")
    seed = scenario.simulation.seed if options.seed is None else options.seed
    if seed < 0:
        raise InputError(f"--seed is {seed}, but must not be negative")
    bench = Bench(scenario, options.records, options.every)
    return Plan(
        scenario=scenario,
        policies=tuple(name.strip() for name in options.policies.split(",")),
        varied=tuple(parse_vary(text, scenario) for text in asked),
        n_points=options.samples or 0,
        sampling=options.sampling,
        states=_states(options, scenario),
        seed=seed,
        kept=str(bench),
    )


def _states(options: argparse.Namespace, scenario: Scenario) -> Array | int:
    text = options.states
    if text is None:
        return 0
    try:
        number = int(text)
    except ValueError:
        return np.array(read_states(Path(text), scenario.station_keeping().problem))
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
            f"{short} of the runs ended with more than a thousandth of the cost still to come, "
            "estimated as ζ'P ζ: their regret says little, raise simulation.duration"
        )
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
