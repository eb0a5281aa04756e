"""`stationkeep offline --gammas`: the value against the attenuation level, from every state."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..comparison.gamma_figure import draw_gamma_curves
from ..offline import GammaCurveSolver
from ..symbolic import InputError, Problem
from .output import Tell, print_table

POINT = ("gamma", "value", "linear_value", "slope")


def requested_curves(
    options: argparse.Namespace, problem: Problem, horizon: float
) -> GammaCurveSolver | None:
    """Return the solver of the levels that were asked for, or None.

    Raises
    ------
    InputError
        If one is not a number or does not exceed the threshold; the message names γ*.
    """
    text: str | None = options.gammas
    if text is None:
        return None
    if text.strip() == "grid":
        return GammaCurveSolver(problem, horizon=horizon)
    try:
        gammas = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"--gammas {text}: give numbers with commas between, for instance 1.2,1.5,2,3, "
            "or the word 'grid'"
        ) from None
    return GammaCurveSolver(problem, gammas, horizon=horizon)


def add_curves(
    solver: GammaCurveSolver | None, rows: list[dict[str, Any]], folder: Path, tell: Tell
) -> None:
    """Add `gamma_curve` and `undisturbed_value` to each row, and draw all curves in one figure."""
    if solver is None:
        return
    curves = []
    for i, row in enumerate(rows):
        tell("values against gamma", i / len(rows))
        curve = solver.solve(row["zeta"])
        row["gamma_curve"] = [{name: getattr(p, name) for name in POINT} for p in curve.points]
        row["undisturbed_value"] = curve.undisturbed.value
        row["faults"] = [*row["faults"], *curve.faults]
        curves.append(curve)
    draw_gamma_curves(folder / "gamma-curve.png", curves)


def print_curves(rows: list[dict[str, Any]]) -> None:
    """Print the curves as a table; nothing if there are none."""
    lines = [
        [str(i + 1), *(f"{point[name]:.8g}" for name in POINT)]
        for i, row in enumerate(rows)
        for point in row.get("gamma_curve", [])
    ]
    if not lines:
        return
    print_table("Value against gamma", ["state", "gamma", "value", "linear", "dV/dgamma"], lines)
    limits = ", ".join(f"{row['undisturbed_value']:.8g}" for row in rows)
    print(f"without disturbance (gamma infinite): {limits}; figure: gamma-curve.png")
