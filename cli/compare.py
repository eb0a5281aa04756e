"""`stationkeep compare`: learned beside optimal, as figures, tables and a report."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import Any

from ..comparison.compare import Comparison, compare
from ..comparison.figures import draw_all
from ..comparison.report import certificate, summary, too_short, verdict, write_report
from ..symbolic import InputError
from .output import load_scenario, output_folder, print_json, print_table, progress


def run(options: argparse.Namespace) -> int:
    """Run learner, baselines and optimum; write figures and report; print the summary."""
    if options.n_states < 1:
        raise InputError(f"--n-states is {options.n_states}, but must be at least 1")
    scenario = load_scenario(options)
    folder = output_folder(options)
    with progress(options) as tell:
        comparison = compare(scenario, folder / "records", n_states=options.n_states, stage=tell)
        tell("figures", 0.0)
        figures = draw_all(comparison, folder / "figures")
        tell("report", 0.0)
        report = write_report(folder / "report.html", comparison, figures, _commands(options))
    if options.json:
        print_json(_answer(comparison, figures, report))
    else:
        _print(comparison, report)
    return 1 if comparison.faults else 0


def _answer(comparison: Comparison, figures: dict[str, Path], report: Path) -> dict[str, Any]:
    regret: dict[str, Any] = comparison.regret or dict.fromkeys(comparison.metrics)
    answer: dict[str, Any] = {
        "regret": regret,
        "envelope_scale": comparison.scenario.envelope.scale,
        "n_states": comparison.n_states,
        "value": float(comparison.optimal.attrs["value"]),
        "value_error": comparison.value_error,
        "figures": figures,
        "report": report,
        "faults": comparison.faults,
    }
    notes = {}
    if comparison.regret is None:
        notes["regret"] = verdict(comparison)
    elif comparison.too_short:
        notes["regret"] = too_short(comparison)
    return answer | {"notes": notes}


def _commands(options: argparse.Namespace) -> list[str]:
    """Return the commands that give the same numbers again."""
    settings = [word for override in options.overrides for word in ("--set", override)]
    count = ["--n-states", str(options.n_states)] if options.n_states > 1 else []
    return [
        shlex.join(["stationkeep", command, options.scenario, *settings, *extra])
        for command, extra in (("compare", count), ("online", []), ("offline", []), ("check", []))
    ]


def _print(comparison: Comparison, report: Path) -> None:
    print_table("Learned beside optimal", *summary(comparison))
    print_table("Certificate of the optimum", *certificate(comparison))
    print(verdict(comparison))
    if comparison.regret is not None and comparison.too_short:
        print(too_short(comparison))
    for fault in comparison.faults:
        print(f"did not converge: {fault}")
    print(f"report: {report}")
