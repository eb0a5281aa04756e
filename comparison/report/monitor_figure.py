"""The figure of the monitor: what the proof asks for, along a run."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..theory import Theory
from .style import LEARNED, LINEAR, OPTIMAL, Page, time_axis

_PLAYERS = (("control actor", LEARNED, "-"), ("disturbance actor", OPTIMAL, "--"))


def draw_monitor(page: Page, learned: xr.Dataset, found: Theory | None) -> None:
    """Draw (18)'s margin, the critic's own, regressors, projection, actors, and V_L if W is known."""
    time = learned["look_time"].values
    margin = float(learned["rank_margin"].min())
    title = f"The theory along the run: the margin of (18) is at least {margin:.1e}"
    with page.figure("monitor", title, 2, 3, 5.6) as panels:
        rank, rows, regressor, projection, apart, last = panels
        _line(rank, time, learned["rank_margin"], "rank margin of (18), λ_min [-]")
        m = learned.sizes["basis"]
        _line(rows, time, learned["row_rank"], f"directions the critic's rows decide, of {m}")
        size = float(learned["regressor_normalized"].max())
        _line(regressor, time, learned["regressor"], f"largest |ω| [1/s] (|ω/p| ≤ {size:.4f})")
        _players(
            projection, time, learned["actor_norm"].values, "|Ŵ_a| / bound (projection acts above 1)"
        )
        projection.axhline(1.0, color="black", lw=1.0, ls=":")
        projection.set_ylim(0.0, 1.15 * max(1.0, float(learned["actor_norm"].max())))
        _players(apart, time, 100.0 * learned["actor_distance"].values, "critic to actor, % of |Ŵ_c|")
        projection.legend(fontsize=7)
        if found is None:
            _line(last, time, learned["fixed_error_rms"], "rms of δ / ζ'Qζ at the samples of (18) [-]")
        else:
            _lyapunov(last, found)
        for axes in panels:
            time_axis(axes, float(time[-1]))


def _line(axes: Axes, time: np.ndarray, values: xr.DataArray, title: str) -> None:
    axes.plot(time, values, color=LEARNED)
    largest = float(values.max())
    axes.set_ylim(0.0, 1.15 * largest if 0.0 < largest < np.inf else 1.0)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    axes.set_title(title)


def _players(axes: Axes, time: np.ndarray, values: np.ndarray, title: str) -> None:
    for column, (label, color, style) in zip(values.T, _PLAYERS, strict=True):
        axes.plot(time, column, style, color=color, label=label)
    axes.set_ylim(bottom=0.0)
    axes.set_title(title)


def _lyapunov(axes: Axes, found: Theory) -> None:
    axes.semilogy(found.time, found.lyapunov, color=LEARNED, label="V_L")
    axes.semilogy(found.time, np.maximum(found.value, 1e-12), "--", color=OPTIMAL, label="V")
    axes.semilogy(found.time, 0.5 * found.errors[:, 0] ** 2, ":", color=LINEAR, label="|W̃_c|²/2")
    axes.set_title("V_L and its parts [cost, cost²]")
    axes.legend(fontsize=7)
