"""`stationkeep compare`: learned beside optimal, as figures, tables and a report."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import Any

from ...comparison import Study, compare
from ...comparison.compare import require_film
from ...comparison.parallel import default_workers
from ...comparison.report import (
    CLAIRVOYANT_CHECK,
    certificate,
    clairvoyant_check,
    summary,
    too_short,
)
from ...symbolic import InputError
from ..output import load_scenario, output_folder, print_json, print_table, progress


def run(options: argparse.Namespace) -> int:
    """Run every policy and the optimum; write figures and report; print the summary."""
    if options.n_states < 1:
        raise InputError(f"--n-states is {options.n_states}, but must be at least 1")
    if options.workers is not None and options.workers < 1:
        raise InputError(f"--workers is {options.workers}, but must be at least 1")
    scenario = load_scenario(options)
    if options.animation:
        require_film(scenario)
    folder = output_folder(options)
    with progress(options) as tell:
        study = compare(
            scenario,
            states=options.n_states,
            out=folder,
            policies=options.policy,
            field=options.field,
            workers=options.workers or default_workers(),
            tell=tell,
        )
        report = study.write_report(_commands(options), tell)
        film = None
        if options.animation:
            tell("animation", 0.0)
            film = study.animate()
    if options.json:
        print_json(_answer(study, report) | {"animation": film})
    else:
        _print(study, report)
        if film is not None:
            print(f"animation: {film}")
    return 1 if study.faults else 0


def _answer(study: Study, report: Path) -> dict[str, Any]:
    regret: dict[str, Any] = dict.fromkeys(study.metrics)
    if study.regret is not None:
        regret = {name: sizes.as_json() for name, sizes in study.regret.items()}
    answer: dict[str, Any] = {
        "regret": regret,
        "envelope_scale": study.scenario.envelope.scale,
        "n_states": study.n_states,
        "value": float(study.optimal.attrs["value"]),
        "value_error": study.value_error,
        "figures": study.figures,
        "report": report,
        "faults": study.faults,
        "verdict": study.verdict,
    }
    notes = {}
    if study.reference.note is not None:  # runs are held against something else than the game
        answer["dissipation_margin"] = study.margins
        answer[study.reference.kind] = _other_optimum(study)
        notes["regret"] = study.reference.note
    if study.regret is None:
        notes["regret"] = notes[study.reference.kind] = study.verdict
    elif study.too_short:
        notes["regret"] = too_short(study)
    return answer | {"notes": notes}


def _other_optimum(study: Study) -> dict[str, Any] | None:
    """Return value, errors and effort of the clairvoyant optimum, None where there is none."""
    if study.reference.record is None:
        return None
    attributes = study.reference.record.attrs
    names = ("value", *CLAIRVOYANT_CHECK, "rounds", "intervals", "iterations", "seconds")
    numbers = {name: float(attributes[name]) for name in names}
    return {name: None if number != number else number for name, number in numbers.items()}


def _commands(options: argparse.Namespace) -> list[str]:
    """Return the commands that give the same numbers again."""
    settings = [word for override in options.overrides for word in ("--set", override)]
    count = ["--n-states", str(options.n_states)]
    count += [word for name in options.policy for word in ("--policy", name)]
    return [
        shlex.join(["stationkeep", command, options.scenario, *settings, *extra])
        for command, extra in (("compare", count), ("online", []), ("offline", []), ("check", []))
    ]


def _print(study: Study, report: Path) -> None:
    print_table("Learned beside optimal", *summary(study))
    print_table("Certificate of the optimum", *certificate(study))
    if study.shown is not study.optimal:
        print_table("Check of the clairvoyant optimum", *clairvoyant_check(study.shown))
    print(study.verdict)
    if study.regret is not None and study.too_short:
        print(too_short(study))
    for fault in study.faults:
        print(f"did not converge: {fault}")
    print(f"report: {report}")
