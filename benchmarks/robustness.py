"""Robustness of the learned policy: random starts, disturbances, thruster limits, noise, another plant.

    python benchmarks/robustness.py [--only starts corners dissipation currents limits noise]
                                    [--starts 1000] [--runs 200] [--workers N] [--rows FILE]

Each table says what its runs are. A run is lost when it ends early: at the pitch limit, beyond chi, or
where the controller or the plant fails; it is counted with its reason, and its other figures are those
up to that moment. Rows are kept in FILE as runs end; what is killed goes on from there. Everything
random is seeded. docs/theory/disturbances.md says what the tables mean.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.parallel import default_workers
from stationkeep.symbolic.underwater import STATE_NAMES
from studies.closed_loops import Row, Run, run_all
from studies.robustness_runs import (
    corner_runs,
    current_runs,
    dissipation_runs,
    limit_runs,
    noise_runs,
    start_runs,
)

Table = Callable[[list[Row]], None]


def grouped(rows: Iterable[Row], *names: str) -> dict[tuple[Any, ...], list[Row]]:
    """Return the rows by the values of some labels, in the order in which they come."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def lost(rows: Sequence[Row]) -> str:
    """Return how many runs were lost, and why."""
    reasons = Counter(row["stopped"].split(" (")[0] for row in rows if row["stopped"])
    told = "; ".join(f"{number} x {reason}" for reason, number in reasons.items())
    return f"{sum(reasons.values())}" + (f" ({told})" if told else "")


def spread(values: Sequence[float], form: str = ".3f") -> str:
    """Return minimum, median and maximum; nothing of nothing."""
    if not values:
        return ""
    return " / ".join(format(q, form) for q in np.quantile(values, [0.0, 0.5, 1.0]))


def print_starts(rows: list[Row]) -> None:
    """Print what became of the runs from random or corner states, and how often the safeguard acted."""
    for (mode,), found in grouped(rows, "mode").items():
        peaks = np.array([row["peak"] for row in found])
        highest = peaks.max(axis=1)
        steps = sum(row["learning_steps"] for row in found)
        shares = [100.0 * sum(row[name] for row in found) / steps for name in ("whole", "part", "none")]
        back = [row["back"] for row in found]
        first = [row["first_back"] for row in found if row["first_back"] is not None]
        at = STATE_NAMES[int(peaks.max(axis=0).argmax())]
        quantiles = " / ".join(f"{q:.2f}" for q in np.quantile(highest, [0.5, 0.99, 1.0]))
        print(f"  {mode}: {len(found)} runs, lost {lost(found)}")
        print(f"    largest |state| [half-widths], median / 99 % / max: {quantiles} ({at})")
        print(
            f"    learning steps {steps}: accepted wholly {shares[0]:.1f} %, partly {shares[1]:.1f} %, "
            f"not {shares[2]:.1f} %"
        )
        print(
            f"    the linear policy instead: {100.0 * sum(back) / steps:.2f} % of the steps; in "
            f"{100.0 * np.mean(np.array(back) > 0):.1f} % of the runs; a run, median / max: "
            f"{np.median(back):.0f} / {max(back)}"
            + (f"; first at, min / median / max: {spread(first, '.2f')} s" if first else "")
        )


def print_dissipation(rows: list[Row]) -> None:
    """Print the margins of γ^2 ∫ d'W_d d + V(ζ_0) >= ∫ (ζ'Qζ + u_1'R u_1) + V(ζ(T))."""
    print(
        f"  {'policy':<12}{'disturbance':<13}{'from':<10}{'runs':>5}{'negative':>10}  "
        f"{'margin: min / median / max':<30}{'of what was supplied and stored [%]':<38}lost"
    )
    for (policy, disturbance, start), found in grouped(rows, "policy", "disturbance", "from").items():
        known = [row for row in found if row["margin"] is not None]
        margins = [row["margin"] for row in known]
        shares = [100.0 * row["margin"] / (row["supplied"] + row["V_start"]) for row in known]
        print(
            f"  {policy:<12}{disturbance:<13}{start:<10}{len(known):>5}"
            f"{sum(margin < 0.0 for margin in margins):>10}  {spread(margins, '.1f'):<30}"
            f"{spread(shares, '.1f'):<38}{lost(found)}"
        )


def print_currents(rows: list[Row]) -> None:
    """Print each disturbed run, without and with the observer."""
    print(
        f"  {'disturbance':<18}{'policy':<10}{'observer':>9}{'rms [m]':>9}{'max [m]':>9}{'end [m]':>9}"
        f"{'cost':>10}{'energy [J]':>12}{'margin':>9}{'[%]':>7}  lost"
    )
    for row in rows:
        share = "" if row["margin"] is None else f"{100.0 * row['margin'] / row['supplied']:.1f}"
        margin = "" if row["margin"] is None else f"{row['margin']:.1f}"
        print(
            f"  {row['disturbance']:<18}{row['policy']:<10}{row['observer']:>9}"
            f"{row['position_rms']:>9.3f}{row['excursion']:>9.3f}{row['offset']:>9.3f}"
            f"{row['spent']:>10.1f}{row['energy']:>12.0f}"
            f"{margin:>9}{share:>7}  {row['stopped'] or ''}"
        )


def print_limits(rows: list[Row]) -> None:
    """Print medians over the runs of a case at each share of the limits."""
    free: dict[tuple[Any, ...], float] = {}
    print(
        f"  {'case':<22}{'limits':>9}  {'policy':<10}{'runs':>5}{'saturated [%]: median / max':>29}"
        f"{'rms [m]':>9}{'cost over that without limits [%]':>36}  lost"
    )
    for (case, limits, policy), found in grouped(rows, "case", "limits", "policy").items():
        if limits == "none":
            free |= {(case, policy, row["number"]): row["spent"] + row["rest"] for row in found}
        over = [
            100.0 * ((row["spent"] + row["rest"]) / free[case, policy, row["number"]] - 1.0)
            for row in found
            if not row["stopped"] and (case, policy, row["number"]) in free
        ]
        saturated = [100.0 * (row["saturated"] or 0.0) for row in found]
        print(
            f"  {case:<22}{limits:>9}  {policy:<10}{len(found):>5}"
            f"{f'{np.median(saturated):.1f} / {max(saturated):.1f}':>29}"
            f"{np.median([row['position_rms'] for row in found]):>9.3f}"
            f"{spread(over, '.2f'):>36}  {lost(found)}"
        )


def print_noise(rows: list[Row]) -> None:
    """Print medians over the runs with noise, another plant and both."""
    print(
        f"  {'case':<18}{'with':<30}{'policy':<10}{'runs':>5}{'rms [m]':>9}{'max [m]':>9}{'cost':>10}"
        f"{'energy [J]':>12}{'linear instead [%]':>20}  lost"
    )
    for (case, variant, policy), found in grouped(rows, "case", "with", "policy").items():
        steps = sum(row["learning_steps"] for row in found)
        back = f"{100.0 * sum(row['back'] for row in found) / steps:.1f}" if steps else ""
        medians = [
            float(np.median([row[name] for row in found]))
            for name in ("position_rms", "excursion", "spent", "energy")
        ]
        print(
            f"  {case:<18}{variant:<30}{policy:<10}{len(found):>5}{medians[0]:>9.3f}{medians[1]:>9.3f}"
            f"{medians[2]:>10.1f}{medians[3]:>12.0f}{back:>20}  {lost(found)}"
        )


def main() -> None:
    """Read the options, make the runs and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="bluerov2-heavy")
    parser.add_argument("--only", nargs="+", choices=TABLES, default=list(TABLES))
    parser.add_argument("--starts", type=int, default=1000, help="random starts a mode")
    parser.add_argument("--duration", type=float, default=8.0, help="of the runs from them [s]")
    parser.add_argument("--runs", type=int, default=200, help="disturbed runs a policy")
    parser.add_argument(
        "--workers", type=int, default=default_workers(), help="0 prints what is there already"
    )
    parser.add_argument("--rows", type=Path, default=Path("results/robustness.jsonl"))
    options = parser.parse_args()
    scenario = Scenario.load(options.scenario)
    for name in options.only:
        plan, table = TABLES[name]
        title, runs = plan(scenario, options)
        rows = run_all(scenario, runs, options.rows, options.workers)
        print(f"{name}: {title}" + ("" if len(rows) == len(runs) else f"; {len(rows)} runs so far"))
        table(rows)
        print(flush=True)


Plan = Callable[[Scenario, argparse.Namespace], tuple[str, list[Run]]]
TABLES: dict[str, tuple[Plan, Table]] = {
    "starts": (start_runs, print_starts),
    "corners": (corner_runs, print_starts),
    "dissipation": (dissipation_runs, print_dissipation),
    "currents": (current_runs, print_currents),
    "limits": (limit_runs, print_limits),
    "noise": (noise_runs, print_noise),
}

if __name__ == "__main__":
    main()
