"""The way back to the station as a film: learned beside optimal, from above and in depth."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib import animation
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ...online.records import written_whole
from ...symbolic import InputError
from ...symbolic.arrays import Array
from ..merit import cost_to_date
from ..records import optimum_name
from .style import LEARNED, OPTIMAL

FRAMES_PER_SECOND = 10
HULL = np.array([[0.25, 0.0], [0.12, 0.14], [-0.25, 0.14], [-0.25, -0.14], [0.12, -0.14], [0.25, 0.0]])


@dataclass(frozen=True)
class Frames:
    """What is drawn at each frame.

    Attributes
    ----------
    time : (F,) [s]
    learned, optimal : (F, 12) states [m, rad, m/s, rad/s]
    learned_cost, optimal_cost : (F,) cost to date
    optimum : what the optimum is called
    """

    time: Array
    learned: Array
    optimal: Array
    learned_cost: Array
    optimal_cost: Array
    optimum: str


def frames(learned: xr.Dataset, optimal: xr.Dataset, n_frames: int) -> Frames:
    """Return the states and costs of two records at `n_frames` equidistant times of the learned run.

    Linear between recorded times; after the optimum's horizon its last state stays.
    """
    time = np.linspace(0.0, float(learned["time"][-1]), n_frames)

    def at(record: xr.Dataset, values: Array) -> Array:
        columns = values.reshape(len(values), -1).T
        return np.array([np.interp(time, record["time"].values, column) for column in columns]).T

    return Frames(
        time,
        at(learned, learned["zeta"].values),
        at(optimal, optimal["zeta"].values),
        at(learned, cost_to_date(learned))[:, 0],
        at(optimal, optimal["cost"].values)[:, 0],
        optimum_name(optimal),
    )


def outline(zeta: Array, size: float) -> Array:
    """Return a hull of length `size` / 2 at x, y and heading ψ of a state, corners (y, x), (6, 2)."""
    c, s = np.cos(zeta[5]), np.sin(zeta[5])
    corners = zeta[:2] + size * HULL @ np.array([[c, s], [-s, c]])
    return np.asarray(corners[:, ::-1])


def animate(folder: Path, learned: xr.Dataset, optimal: xr.Dataset, *, speed: float = 4.0) -> Path:
    """Write `animation.mp4`, or .gif where there is no ffmpeg, `speed` times as fast as the vehicle.

    Raises
    ------
    InputError
        If matplotlib finds no writer, or the folder can't be written.
    """
    name, suffix = _writer()
    n_frames = max(2, round(float(learned["time"][-1]) / speed * FRAMES_PER_SECOND) + 1)
    shown, path = frames(learned, optimal, n_frames), folder / f"animation{suffix}"
    with _look(), written_whole(path) as temporary:
        sheet = Figure(figsize=(8.0, 4.4), dpi=80, layout="constrained")
        FigureCanvasAgg(sheet)
        draw = _Scene(sheet, shown).draw
        sheet.draw_without_rendering()
        sheet.set_layout_engine("none")  # laid out once: nothing moves between frames, and it is slow
        film = animation.writers[name](fps=FRAMES_PER_SECOND)
        written = temporary.with_name(f"{temporary.name}{suffix}")  # the suffix chooses the format
        try:
            with film.saving(sheet, str(written), dpi=80):
                for i in range(n_frames):
                    draw(i)
                    film.grab_frame()
            written.replace(temporary)
        finally:
            written.unlink(missing_ok=True)
    return path


def _writer() -> tuple[str, str]:
    for name, suffix in (("ffmpeg", ".mp4"), ("pillow", ".gif")):
        if animation.writers.is_available(name):
            return name, suffix
    raise InputError("matplotlib finds nothing that writes a film; install ffmpeg, or Pillow for a GIF")


@contextmanager
def _look() -> Iterator[None]:
    look = {"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "axes.titlelocation": "left"}
    with mpl.rc_context(look):  # type: ignore[arg-type]
        yield


class _Scene:
    """Plan view, depth and cost to date; `draw` moves everything to a frame."""

    def __init__(self, sheet: Figure, shown: Frames) -> None:
        self.shown = shown
        grid = sheet.add_gridspec(2, 2, width_ratios=[1.3, 1.0])
        plan = sheet.add_subplot(grid[:, 0])
        depth, cost = sheet.add_subplot(grid[0, 1]), sheet.add_subplot(grid[1, 1])
        runs = (
            (shown.optimum, OPTIMAL, shown.optimal, shown.optimal_cost),
            ("learned", LEARNED, shown.learned, shown.learned_cost),
        )
        reach = float(np.abs(np.concatenate([shown.learned, shown.optimal])[:, :2]).max())
        self.size = max(0.5, 0.35 * reach)
        self.moving = []
        for name, color, zeta, spent in runs:
            plan.plot(zeta[:, 1], zeta[:, 0], color=color, lw=0.8, alpha=0.4)
            (hull,) = plan.plot([], [], color=color, label=name)
            (below,) = depth.plot([], [], color=color)
            (paid,) = cost.plot([], [], color=color)
            self.moving.append((zeta, spent, hull, below, paid))
        plan.plot(0.0, 0.0, "+", color="black", ms=10)
        plan.margins(0.2)  # room for the hulls
        plan.set_aspect("equal", adjustable="datalim")
        plan.set(xlabel="y, east [m]", ylabel="x, north [m]")
        plan.legend(frameon=False, loc="lower left")
        self.title = plan.set_title("from above")
        self._panels(depth, cost)

    def _panels(self, depth: Axes, cost: Axes) -> None:
        shown = self.shown
        both = np.concatenate([shown.learned, shown.optimal])[:, 2]
        room = 0.1 * max(float(np.ptp(both)), 0.1)
        depth.set(title="depth below the station [m]", xlim=(0.0, shown.time[-1]))
        depth.set_ylim(float(both.max()) + room, float(both.min()) - room)  # z points down
        most = max(float(shown.learned_cost.max()), float(shown.optimal_cost.max()), 1e-9)
        cost.set(title="cost to date", xlabel="time [s]", ylim=(0.0, 1.1 * most))
        cost.set_xlim(0.0, shown.time[-1])

    def draw(self, i: int) -> None:
        """Show the i-th frame."""
        time = self.shown.time[: i + 1]
        self.title.set_text(f"from above, t = {time[-1]:.1f} s")
        for zeta, spent, hull, below, paid in self.moving:
            hull.set_data(*outline(zeta[i], self.size).T)
            below.set_data(time, zeta[: i + 1, 2])
            paid.set_data(time, spent[: i + 1])
