"""The value of the game against the attenuation level, nonlinear beside linear."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from ...offline import GammaCurve
from .style import LINEAR, PALETTE, Page, legend_below

TICKS = (1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # of γ / γ*


def draw_gamma_curves(path: Path, curves: Sequence[GammaCurve]) -> Path:
    """Draw value and slope of every curve against γ into a PNG file, and a PDF file beside it.

    As many states as there are colours get a name each.
    """
    named = 1 < len(curves) <= len(PALETTE)
    page = Page(path.parent)
    with page.figure(path.stem, "The value of the game against γ", 1, 2, 4.2) as (values, slopes):
        for i, curve in enumerate(curves):
            name = f"state {i + 1}" if named else "nonlinear game" if i == 0 else None
            _draw_curve(values, slopes, curve, PALETTE[i] if named else PALETTE[0], name)
        values.plot([], [], "--", color=LINEAR, label="linearised game, ζ'Pζ")
        values.plot([], [], ":", color=LINEAR, linewidth=1.0, label="without disturbance, γ = ∞")
        for axes in (values, slopes):
            _scale(axes)
            _gamma_axis(axes, curves)
        values.set_title("Value V(ζ)")
        slopes.set_title("Slope −dV/dγ = 2γ ∫ u₂'W_d u₂ dt")
        legend_below(values, 4)
    return path


def _draw_curve(values: Axes, slopes: Axes, curve: GammaCurve, color: str, name: str | None) -> None:
    gamma, value, linear, slope = (
        np.array([getattr(point, key) for point in curve.points])
        for key in ("gamma", "value", "linear_value", "slope")
    )
    values.plot(gamma, value, "o-", color=color, markersize=3.5, label=name)
    values.plot(gamma, linear, "--", color=color, alpha=0.6)
    values.axhline(curve.undisturbed.value, color=color, linestyle=":", linewidth=1.0)
    slopes.plot(gamma, -slope, "o-", color=color, markersize=3.5)


def _scale(axes: Axes) -> None:
    """Choose a logarithmic axis where the curves are more than a factor of 20 apart."""
    numbers = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.lines])
    positive = numbers[numbers > 0.0]
    if positive.max(initial=0.0) > 20.0 * positive.min(initial=np.inf):
        axes.set_yscale("log")


def _gamma_axis(axes: Axes, curves: Sequence[GammaCurve]) -> None:
    star = curves[0].gamma_star
    largest = max(point.gamma for point in curves[0].points)
    axes.set_xscale("log")
    axes.axvline(star, color=LINEAR, linewidth=1.0)
    axes.annotate(
        f"γ* = {star:.4g}",
        (star, 0.0),
        (4, 6),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        color=LINEAR,
    )
    ticks = star * np.array(TICKS)
    axes.set_xticks(ticks[ticks <= 1.05 * max(largest, 1.2 * star)])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(StrMethodFormatter("{x:.4g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("γ")
