"""Worst cases of the learned policy beside linear H-infinity and LQR, solved for and played, printed.

python benchmarks/worst_case.py [--states N] [--scales 0.35,1.0] [--workers N] [--json FILE]

Excess is (cost - V*) / V* in percent, from states s × half-widths × U(-1, 1)^12 × U(0.1, 1).
`solved` is the worst disturbance against the policy as a feedback, `played` the same disturbance as
a force d(t) in the closed loop with held wrenches. The frozen policies are the weights after 40
learning steps at the very state (`settled`) and what one run from another state remembered
(`remembered`), both without safeguard. `schedule` is the worst case against the weights W(t) that
the learner left behind in the round before, `learner` the largest cost of anything that was played
against the learner while it learned on: a lower bound of its worst case, which has no other
(offline/schedule.py).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import Regret
from stationkeep.comparison.parallel import Work, run_tasks
from stationkeep.online import draw_samples, run
from stationkeep.online.records import write_text
from studies.worst_cases import StateWorstCases, WorstCases

SEED = 20
FROZEN = ("linear", "lqr", "settled", "remembered", "schedule")
Shipment = tuple[Scenario, np.ndarray, int]


def remembered(scenario: Scenario) -> np.ndarray:
    """Return what one run from a state that is not in the table remembers of the envelope."""
    (start,) = draw_samples(scenario.station_keeping().envelope, 1, SEED + 1)
    history = run(
        scenario.with_settings(simulation={"initial_state": start}, samples={"remember": True})
    )
    assert history.remembered is not None
    return history.remembered


def worker(shipment: Shipment) -> Work[np.ndarray, StateWorstCases]:
    """Build what all states share, once in a process."""
    scenario, weights, probes = shipment
    cases = WorstCases(scenario, weights, probes=probes)

    def work(zeta: np.ndarray) -> Iterator[StateWorstCases]:
        yield cases.at(zeta)

    return work


def table(scale: float, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Print the table of one scale, and return its rows."""
    settings = [f"envelope.scale={scale}", "simulation.chi=4", *options.set]
    scenario = Scenario.load(options.scenario, settings)
    states = draw_samples(scenario.station_keeping().envelope, options.states, SEED)
    shipment = scenario, remembered(scenario), options.probes
    found: dict[int, StateWorstCases] = {}
    with closing(run_tasks(worker, shipment, list(states), options.workers)) as events:
        for event in events:
            if event.message is None:
                print(f"state {event.task + 1}: {event.failure}", file=sys.stderr)
                continue
            found[event.task] = event.message
            print(f"scale {scale:g}: {len(found)} of {len(states)} states", file=sys.stderr, flush=True)
    print(f"\nscale {scale:g}, {len(found)} states; excess over V* [%], solved (played)")
    print(f"{'':>5}{'V*':>10}" + "".join(f"{name:>19}" for name in FROZEN) + f"{'learner':>9}  by")
    rows = [found[i] for i in sorted(found)]
    for i, row in zip(sorted(found), rows, strict=True):
        cells = "".join(cell(row, name) for name in FROZEN)
        by = max(row.against_learner, key=lambda name: _or_inf(row.against_learner[name]))
        print(f"{i + 1:>5}{row.value:>10.2f}{cells}{_percent(row.learner):>9}  {by}")
    summary(rows)
    return [asdict(row) | {"zeta": row.zeta.tolist(), "learner": row.learner} for row in rows]


def cell(row: StateWorstCases, name: str) -> str:
    """Return what is printed of a policy: solved and, in brackets, played."""
    found = row.policies[name]
    doubt = "" if found.strict or not np.isfinite(found.excess) else "?"
    played = "lost" if found.played is None else _percent(found.played)
    return f"{_percent(found.excess) + doubt:>10}{'(' + played + ')':>9}"


def summary(rows: list[StateWorstCases]) -> None:
    """Print median, 90 % and maximum of each column, and who is below linear where."""
    linear = np.array([row.policies["linear"].excess for row in rows])
    columns = {name: [row.policies[name].excess for row in rows] for name in FROZEN}
    columns["learner"] = [row.learner for row in rows]
    for name, column in columns.items():
        values = np.array(column)
        one = Regret.of(column)
        figures = " / ".join(map(_percent, (one.median, one.p90, one.max)))
        print(
            f"{name:<11} median / 90 % / maximum {figures} %   smaller than linear from "
            f"{int(np.sum(values < linear))} of {len(rows)}"
        )
    notes = {
        f"{name}, state {i + 1}: {row.policies[name].note}"
        for i, row in enumerate(rows)
        for name in FROZEN
        if row.policies[name].note is not None
    }
    print("\n".join(sorted(notes)))
    solved = [
        one.reintegration for row in rows for one in row.policies.values() if np.isfinite(one.excess)
    ]
    strict = sum(one.strict for row in rows for one in row.policies.values())
    print(
        f"{strict} of {len(solved)} maxima strict; scipy's cost of the closed loops differs by at most "
        f"{max(solved):.1e}"
    )


def _percent(value: float) -> str:
    return f"{100.0 * value:.3f}" if np.isfinite(value) else "none"


def _or_inf(value: float | None) -> float:
    return np.inf if value is None else value


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="bluerov2-heavy")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--scales", default="0.35,1.0")
    parser.add_argument("--probes", type=int, default=2, help="variations played against the learner")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", type=Path, help="also write the rows there")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    tables = {scale: table(float(scale), options) for scale in options.scales.split(",")}
    if options.json:
        write_text(options.json, json.dumps(tables, indent=1))
