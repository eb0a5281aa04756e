"""`stationkeep compare`: learned beside optimal, as figures, tables and a report."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import Any

from ...comparison import Comparison, compare
from ...comparison.parallel import default_workers
from ...comparison.report import (
    CLAIRVOYANT_CHECK,
    REGRET_OF_A_RUN,
    Page,
    certificate,
    clairvoyant_check,
    draw_all,
    summary,
    too_short,
    verdict,
    write_report,
)
from ...comparison.study import Field, Plan
from ...symbolic import InputError
from ..output import Tell, load_scenario, output_folder, print_json, print_table, progress


def run(options: argparse.Namespace) -> int:
    """Run every policy and the optimum; write figures and report; print the summary."""
    if options.n_states < 1:
        raise InputError(f"--n-states is {options.n_states}, but must be at least 1")
    if options.workers is not None and options.workers < 1:
        raise InputError(f"--workers is {options.workers}, but must be at least 1")
    plan = Plan(load_scenario(options), options.n_states, Field.of(options.field))
    folder = output_folder(options)
    n_workers = options.workers or default_workers()
    pages = (Page(folder / "figures"), Page(None))
    with progress(options) as tell:
        comparison = compare(plan, folder / "records", n_workers=n_workers, tell=tell)
        for i, page in enumerate(pages):
            tell("figures", i / len(pages))
            draw_all(comparison, page)
        tell("report", 0.0)
        film = _film(options, comparison, folder / "figures", tell)
        report = write_report(folder / "report.html", comparison, *pages, _commands(options))
    if options.json:
        print_json(_answer(comparison, pages[0].files, report) | {"animation": film})
    else:
        _print(comparison, report)
        if film is not None:
            print(f"animation: {film}")
    return 1 if comparison.faults else 0


def _film(options: argparse.Namespace, comparison: Comparison, folder: Path, tell: Tell) -> Path | None:
    """Write the film of the learned run beside the optimum, if it is asked for."""
    if not options.animation:
        return None
    from ...comparison.report import animate

    tell("animation", 0.0)
    return animate(folder, comparison.records["learned"], comparison.reference)


def _answer(comparison: Comparison, figures: dict[str, Path], report: Path) -> dict[str, Any]:
    regret: dict[str, Any] = dict.fromkeys(comparison.metrics)
    if comparison.regret is not None:
        regret |= {name: one.as_json() for name, one in comparison.regret.items()}
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
    if comparison.disturbed:
        answer["dissipation_margin"] = comparison.margins
        answer["clairvoyant"] = _clairvoyant(comparison)
        notes["regret"] = REGRET_OF_A_RUN
    if comparison.regret is None:
        notes["regret"] = notes["clairvoyant"] = verdict(comparison)
    elif comparison.too_short:
        notes["regret"] = too_short(comparison)
    return answer | {"notes": notes}


def _clairvoyant(comparison: Comparison) -> dict[str, Any] | None:
    """Return value, errors and effort of the clairvoyant optimum, None where there is none."""
    if comparison.clairvoyant is None:
        return None
    attributes = comparison.clairvoyant.attrs
    names = ("value", *CLAIRVOYANT_CHECK, "rounds", "intervals", "iterations", "seconds")
    numbers = {name: attributes[name].item() for name in names}
    return {name: None if number != number else number for name, number in numbers.items()}


def _commands(options: argparse.Namespace) -> list[str]:
    """Return the commands that give the same numbers again."""
    settings = [word for override in options.overrides for word in ("--set", override)]
    count = ["--n-states", str(options.n_states)]
    return [
        shlex.join(["stationkeep", command, options.scenario, *settings, *extra])
        for command, extra in (("compare", count), ("online", []), ("offline", []), ("check", []))
    ]


def _print(comparison: Comparison, report: Path) -> None:
    print_table("Learned beside optimal", *summary(comparison))
    print_table("Certificate of the optimum", *certificate(comparison))
    if comparison.clairvoyant is not None:
        print_table("Check of the clairvoyant optimum", *clairvoyant_check(comparison.clairvoyant))
    print(verdict(comparison))
    if comparison.regret is not None and comparison.too_short:
        print(too_short(comparison))
    for fault in comparison.faults:
        print(f"did not converge: {fault}")
    print(f"report: {report}")
