"""Regret of the learned policies beside the linear H-infinity policy, over random states, printed.

    python benchmarks/regret.py [--states N] [--scales 0.1,0.35] [--workers N] [--cache DIR]
    python benchmarks/regret.py --only starts

Regret is (cost - V*) / V* in `game` mode, with ζ'P ζ for what is left at the end of a run and V* from
the direct solve. States are s x half-widths x U(-1, 1)^12 x U(0.1, 1), seeded. A run that ends early
counts as infinite regret. `online` starts each run from the Riccati weights and is scored while it
learns; `frozen` uses, without learning, what one run from another state remembered; `gradient` is (19)
as printed. Every ratio is to the linear policy on the same states.

The second form tells what becomes of wrong starts: half of P, the P of a vehicle with half the added
mass, and zero.

FinishedRun runs are kept in DIR, each under the hash of all that it depends on: what was killed goes on
where it was.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import Regret
from stationkeep.comparison.parallel import default_workers
from stationkeep.online import draw_samples
from stationkeep.symbolic import StationkeepError
from studies.cases import Case, Row, regrets
from studies.kept import Keep
from studies.lesson import lesson
from studies.targets import MOONSHOT, REQUIRED, target
from studies.wrong_starts import print_starts, print_zero

SEED = 20
BETWEEN_NOTES = 10.0  # s


class Told:
    """Progress on stderr, now and then, with the time that is left."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.started = self.shown = time.monotonic()

    def __call__(self, there: int, made: int, total: int) -> None:
        """Tell that `there` of `total` runs are there, `made` of them in this process."""
        now = time.monotonic()
        if now - self.shown > BETWEEN_NOTES and there < total:
            self.shown = now
            left = (now - self.started) / made * (total - there)
            print(f"{self.what}: {there}/{total} runs, {left / 60:.1f} min left", file=sys.stderr)


def with_scale(options: argparse.Namespace, scale: float) -> Scenario:
    """Return the scenario of the command line at a scale of the envelope."""
    scenario = Scenario.load(options.scenario, [f"envelope.scale={scale}", *options.set])
    return scenario.with_settings(simulation={"duration": options.duration, "mode": "game"})


def keep(options: argparse.Namespace, what: str) -> Keep:
    """Return where runs are kept, and what tells of them."""
    return Keep(options.cache / "runs.jsonl", options.workers, Told(what))


def print_table(options: argparse.Namespace) -> None:
    """Print one row a policy and scale."""
    print(
        f"regret above V* in %, {options.states} states a scale, {options.duration:g} s each;  "
        "required and moonshot: median / maximum; worse: states from which it costs more than linear\n"
        f"{'s':>5} {'policy':<9}{'median':>8}{'90 %':>8}{'max':>8}{'failed':>8}{'worse':>7}"
        f"{'of linear: median':>20}{'max':>7}{'  required':<18}{'moonshot':<18}{'real time x':>11}"
    )
    for scale in options.scales:
        scenario = with_scale(options, scale)
        envelope = scenario.station_keeping().envelope
        (start,) = draw_samples(envelope, 1, SEED + 1)
        learned = lesson(scenario, Case("lesson"), start, options.cache)
        if learned.stopped:
            print(f"the run that `frozen` learns from ended early: {learned.stopped}", file=sys.stderr)
        weights = {"learner": {"weights": str(learned.path.resolve())}}
        cases = [
            Case("linear", "linear"),
            Case("online"),
            Case("frozen", changes=weights, learn=False),
            Case("gradient", "gradient"),
        ]
        cases = [case for case in cases if case.name in ("linear", *options.policies)]
        states = draw_samples(envelope, options.states, SEED)
        found = regrets(scenario, cases, states, keep(options, f"s = {scale:g}"))
        # a linear policy that lost the vehicle somewhere excuses nobody
        linear = Regret.of(row.regret for row in found["linear"] if np.isfinite(row.regret))
        for name, rows in found.items():
            pairs = zip(rows, found["linear"], strict=True)
            worse = sum(row.regret > other.regret for row, other in pairs)
            print_row(scale, name, rows, linear, worse)


def print_row(scale: float, name: str, rows: list[Row], linear: Regret, worse: int) -> None:
    """Print the figures of a policy at a scale, and the reasons of its failures on stderr."""
    one = Regret.of(row.regret for row in rows)
    figures = "".join(f"{100 * value:8.3f}" for value in (one.median, one.p90, one.max))
    line = f"{scale:5.2f} {name:<9}{figures}{one.diverged:>8}"
    if name != "linear":
        line += f"{worse:>7}{one.median / linear.median:20.3f}{one.max / linear.max:7.3f}  "
        for limits in (target(REQUIRED, scale), target(MOONSHOT, scale)):
            line += f"{' / '.join('met' if m else 'missed' for m in limits.met(one, linear)):<18}"
    else:
        line += " " * 72
    speed = [row.simulated / row.seconds for row in rows if row.seconds > 0.0]
    print(f"{line.ljust(105)}{np.median(speed):9.0f}", flush=True)
    for reason in {row.stopped for row in rows if row.stopped}:
        print(f"  {name}: {reason}", file=sys.stderr)


def main() -> int:
    """Read the options and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="bluerov2-heavy")
    parser.add_argument("--states", type=int, default=100, help="a scale")
    parser.add_argument("--scales", type=numbers, default=(0.1, 0.35, 0.6, 1.0), metavar="S,...")
    parser.add_argument("--policies", type=names, default=POLICIES, metavar="NAME,...", help=HELP)
    parser.add_argument("--duration", type=float, default=60.0, help="of a run [s]")
    parser.add_argument("--workers", type=int, default=default_workers())
    parser.add_argument("--cache", type=Path, default=Path("results/regret"), metavar="DIR")
    parser.add_argument("--only", choices=("table", "starts"), default="table")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    if options.states < 1:
        parser.error(f"--states is {options.states}, but must be at least 1")
    try:
        if options.only == "table":
            print_table(options)
        else:
            scenario = with_scale(options, 0.35)
            states = draw_samples(scenario.station_keeping().envelope, options.states, SEED)
            (start,) = draw_samples(scenario.station_keeping().envelope, 1, SEED + 1)
            print_starts(scenario, states, start, options.cache, lambda what: keep(options, what))
            print_zero(scenario, states, lambda what: keep(options, what))
    except StationkeepError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"interrupted; finished runs are in {options.cache}", file=sys.stderr)
        return 130
    return 0


POLICIES = ("online", "frozen", "gradient")
HELP = f"beside linear; of {', '.join(POLICIES)}"


def numbers(text: str) -> tuple[float, ...]:
    """Return numbers separated by commas."""
    return tuple(float(part) for part in text.split(","))


def names(text: str) -> tuple[str, ...]:
    """Return names of policies separated by commas."""
    given = tuple(text.split(","))
    if not set(given) <= set(POLICIES):
        raise argparse.ArgumentTypeError(f"'{text}' must name policies of {', '.join(POLICIES)}")
    return given


if __name__ == "__main__":
    sys.exit(main())
