"""The way back in space: in three dimensions, and from above with the heading."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ...symbolic.arrays import Array
from ..policies import CONTENDERS
from ..records import optimum_name
from .style import COLORS, Page, legend_below

SHOWN = ("learned", "linear", "mpc", "pid")
ARROWS = 12
LABELS = {"optimal": "offline optimum", "clairvoyant": "clairvoyant optimum"}


def draw_path(page: Page, records: Mapping[str, xr.Dataset], optimal: xr.Dataset) -> None:
    """Draw the ways of some policies and of the optimum; arrows show the heading at equal distances."""
    paths = {name: records[name]["zeta"].values for name in SHOWN if name in records}
    paths["optimal"] = optimal["zeta"].values
    with page.figure("path", "The way back to the station", 1, 2, 4.4, solid=0) as (solid, plan):
        _draw_space(solid, paths)
        _draw_plan(plan, paths, LABELS[optimum_name(optimal)])
        legend_below(plan, columns=6)


def _draw_space(axes: Any, paths: Mapping[str, Array]) -> None:
    for name, zeta in paths.items():
        axes.plot(*zeta[:, :3].T, _style(name), color=COLORS[name], lw=1.4)
    axes.scatter(0.0, 0.0, 0.0, color="black", marker="+", s=80)
    axes.scatter(*paths["learned"][0, :3], color="black", s=18)
    axes.invert_zaxis()
    axes.set_xlabel("x, north [m]")
    axes.set_ylabel("y, east [m]")
    axes.set_zlabel("z, down [m]")
    axes.set_title("In space (dot: start)")
    axes.locator_params(nbins=4)
    axes.set_box_aspect(None, zoom=0.84)


def _draw_plan(axes: Axes, paths: Mapping[str, Array], label_of_optimum: str) -> None:
    """Draw y to the right and x upwards, as on a chart; an arrow points where the bow does."""
    for name, zeta in paths.items():
        label = CONTENDERS[name].label if name in CONTENDERS else label_of_optimum
        axes.plot(zeta[:, 1], zeta[:, 0], _style(name), color=COLORS[name], lw=1.4, label=label)
        if name in ("learned", "optimal"):
            x, y, psi = zeta[equal_distances(zeta[:, :2], ARROWS)][:, (0, 1, 5)].T
            axes.quiver(
                *(y, x, np.sin(psi), np.cos(psi)),
                color=COLORS[name],
                scale=14.0,
                width=0.005,
                pivot="tail",
            )
    axes.plot(0.0, 0.0, "k+", ms=10)
    axes.plot(paths["learned"][0, 1], paths["learned"][0, 0], "ko", ms=4)
    axes.margins(0.12)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("y, east [m]")
    axes.set_ylabel("x, north [m]")
    axes.set_title("From above (arrows: heading)")


def equal_distances(points: Array, count: int) -> Array:
    """Return the rows of `points`, (N, 2), nearest to `count` equal distances along their way."""
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    return np.unique(np.searchsorted(way, np.linspace(0.0, 0.999 * way[-1], count)))


def _style(name: str) -> str:
    return "--" if name == "optimal" else "-"
