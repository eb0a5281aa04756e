"""`stationkeep offline --gammas`: the value against the attenuation level, from every state."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from ..offline import GammaCurve, GammaCurveSolver, Limits
from ..symbolic import InputError, Problem
from .output import print_table, progress

SHOWN = 9  # states whose curves are drawn and printed
POINT = ("gamma", "value", "linear_value", "slope")


class Curves:
    """The curves of all states, if levels were asked for.

    Parameters
    ----------
    options : with `gammas`, levels or the word "grid", or None
    horizon : [s]
    limits : of each curve

    Raises
    ------
    InputError
        If a level is not a number or does not exceed the threshold; the message names γ*.
    """

    def __init__(
        self, options: argparse.Namespace, problem: Problem, horizon: float, limits: Limits
    ) -> None:
        self._options = options
        self._lines: list[list[str]] = []
        self._limits: list[str] = []
        self._curves: list[GammaCurve] = []
        self._solver: GammaCurveSolver | None = None
        text: str | None = options.gammas
        if text is not None:
            self._solver = GammaCurveSolver(problem, _levels(text), horizon=horizon, limits=limits)

    def each(self, rows: Iterable[dict[str, Any]], n_rows: int) -> Iterator[dict[str, Any]]:
        """Yield the rows with `gamma_curve` and `undisturbed_value` added."""
        if self._solver is None:
            yield from rows
            return
        with progress(self._options) as tell:
            for i, row in enumerate(rows):
                tell("values against gamma", i / n_rows)
                yield row | self._row(self._solver, i, row)

    def _row(self, solver: GammaCurveSolver, i: int, row: dict[str, Any]) -> dict[str, Any]:
        curve = solver.solve(row["zeta"])
        points = [{name: getattr(point, name) for name in POINT} for point in curve.points]
        limit = curve.undisturbed.value
        if i < SHOWN:
            self._curves.append(curve)
            self._lines += [[str(i + 1), *(_number(p[name]) for name in POINT)] for p in points]
            self._limits.append(_number(limit))
        return {
            "gamma_curve": points,
            "undisturbed_value": limit,
            "faults": [*row["faults"], *curve.faults],
        }

    def draw(self, folder: Path) -> None:
        """Draw the first curves in one figure; nothing if there are none."""
        if self._curves:
            from ..comparison.report import draw_gamma_curves  # and with it matplotlib

            draw_gamma_curves(folder / "gamma-curve.png", self._curves)

    def show(self) -> None:
        """Print the first curves as a table; nothing if there are none."""
        if not self._lines:
            return
        header = ["state", "gamma", "value", "linear", "dV/dgamma"]
        print_table("Value against gamma", header, self._lines)
        limits = ", ".join(self._limits)
        print(f"without disturbance (gamma infinite): {limits}; figure: gamma-curve.png")


def _levels(text: str) -> list[float] | None:
    if text.strip() == "grid":
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"--gammas {text}: give numbers with commas between, for instance 1.2,1.5,2,3, "
            "or the word 'grid'"
        ) from None


def _number(value: float) -> str:
    return f"{value:.8g}"
