"""One look for all figures: sizes, colours and names that stay the same from figure to figure."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..online.record import written_whole

LEARNED, OPTIMAL, LINEAR = "#c1440e", "#12436d", "#8a8a8a"
PALETTE = ("#12436d", "#c1440e", "#28a197", "#801650", "#f2a541", "#6c6c6c")

_LOOK = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "figure.dpi": 130,
    "font.size": 9,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
}


@contextmanager
def figure(path: Path, title: str, rows: int, columns: int, height: float) -> Iterator[list[Axes]]:
    """Yield the axes of a new figure row by row; write it as PNG when the block succeeds."""
    with mpl.rc_context(_LOOK):  # type: ignore[arg-type]
        sheet = Figure(figsize=(9.0, height), layout="constrained")
        FigureCanvasAgg(sheet)
        grid = sheet.subplots(rows, columns, squeeze=False)
        sheet.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
        yield [axes for row in grid for axes in row]
        with written_whole(path) as temporary:
            sheet.savefig(temporary, format="png")


def legend_above(axes: Axes) -> None:
    """Put the legend of one panel beside the title, for all panels."""
    handles, labels = axes.get_legend_handles_labels()
    axes.figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))


def legend_below(axes: Axes, columns: int, title: str | None = None) -> None:
    """Put the legend of one panel below all panels."""
    handles, labels = axes.get_legend_handles_labels()
    axes.figure.legend(handles, labels, loc="outside lower center", ncols=columns, title=title)
