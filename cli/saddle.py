"""`stationkeep offline --saddle`: both players' best responses, and the linear policy's worst case."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from ..comparison.optima import record_path
from ..comparison.records import trajectory_of
from ..offline import BestResponse, ControlPolicy, Limits, WorstCase, WorstCaseSolver, linear_policy
from ..online import load
from ..symbolic import Problem, RunError
from .output import print_table, progress

UNKNOWN_SADDLE = dict.fromkeys(("upper", "lower", "gap", "second_order"))


class Saddle:
    """Best responses and worst cases of all states, if they were asked for."""

    def __init__(self, options: argparse.Namespace, problem: Problem, limits: Limits) -> None:
        self._options = options
        self._limits = limits
        self._problem = problem
        self._lines: list[list[str]] = []

    def each(
        self, rows: Iterable[dict[str, Any]], folder: Path, n_rows: int
    ) -> Iterator[dict[str, Any]]:
        """Yield the rows with `saddle` and `worst_case` added, from the records in `folder`."""
        if not self._options.saddle:
            yield from rows
            return
        best = BestResponse(self._problem, limits=self._limits)
        policy = ControlPolicy(self._problem, linear_policy(self._problem))
        worst = WorstCaseSolver(policy, limits=self._limits)
        with progress(self._options) as tell:
            for i, row in enumerate(rows):
                tell("best responses and worst cases", i / n_rows)
                added = self._row(row, best, worst, record_path(folder, i))
                self._lines.append([str(i + 1), *_cells(added)])
                yield row | added

    def _row(
        self, row: dict[str, Any], best: BestResponse, worst: WorstCaseSolver, path: Path
    ) -> dict[str, Any]:
        faults = list(row["faults"])
        saddle: dict[str, Any] = dict(UNKNOWN_SADDLE)
        if row["value"]:
            try:
                found = best.solve(row["zeta"], row["value"], trajectory_of(load(path)))
                saddle = {"upper": found.upper, "lower": found.lower, "gap": found.gap}
                saddle["second_order"] = found.holds
            except RunError as error:
                faults.append(f"best responses: {error}")
        case = worst.solve(row["zeta"])
        if case.ended:
            faults.append(f"worst case: {case.unbounded}")
        linear = _described(case, row["value"]) | {"l2_gain": worst.policy.l2_gain}
        return {"saddle": saddle, "worst_case": {"linear": linear}, "faults": faults}

    def show(self) -> None:
        """Print what was found as a table; nothing if it was not asked for."""
        if self._lines:
            header = ["state", "upper", "lower", "gap", "second order", "linear: worst cost"]
            header += ["above V", "L2 gain"]
            print_table("Saddle from both sides; the linear policy's worst case", header, self._lines)


def _described(case: WorstCase, value: float | None) -> dict[str, Any]:
    bounded = case.unbounded is None
    return {
        "cost": case.cost if bounded else None,
        "excess": case.excess(value) if bounded and value else None,
        "bounded": None if case.ended else bounded,
        "note": case.unbounded,
    }


def _cells(added: dict[str, Any]) -> list[str]:
    saddle, linear = added["saddle"], added["worst_case"]["linear"]
    known = saddle["gap"] is not None
    return [
        *(f"{saddle[name]:.8g}" if known else "–" for name in ("upper", "lower")),
        f"{saddle['gap']:.1e}" if known else "–",
        {True: "yes", False: "no", None: "–"}[saddle["second_order"]],
        {True: f"{linear['cost'] or 0.0:.8g}", False: "unbounded", None: "–"}[linear["bounded"]],
        "–" if linear["excess"] is None else f"{100 * linear['excess']:.2f} %",
        f"{linear['l2_gain']:.4f}",
    ]
