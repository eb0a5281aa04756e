"""One look for all figures: sizes, colours and names that stay the same from figure to figure."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ...online.records import written_whole
from ..records import optimum_name

LEARNED, OPTIMAL, LINEAR = "#c1440e", "#12436d", "#8a8a8a"
PALETTE = ("#12436d", "#c1440e", "#28a197", "#801650", "#f2a541", "#6c6c6c")
COLORS = {
    "optimal": OPTIMAL,
    "learned": LEARNED,
    "linear": LINEAR,
    "lqr": "#28a197",
    "pid": "#801650",
    "mpc": "#f2a541",
    "quadratic": "#e08a63",
    "gradient": "#4d4d4d",
}
OWN = ("#7b2cbf", "#6a994e", "#4d9de0", "#b0a18f")  # policies of the user's, in their order
WIDE, NARROW = 9.0, 4.4  # inches: a page, and a phone

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
    "pdf.fonttype": 42,  # text stays text
}


@dataclass(frozen=True)
class Page:
    """Where figures go: PNG and PDF in a folder, or one column for a phone, kept in memory.

    Attributes
    ----------
    folder : of the PNG and PDF files; None draws for a phone
    pictures : PNG of each figure by name, in the order of drawing
    files : the PNG file of each figure, likewise; none for a phone
    """

    folder: Path | None
    pictures: dict[str, bytes] = field(default_factory=dict)
    files: dict[str, Path] = field(default_factory=dict)

    @property
    def narrow(self) -> bool:
        """Whether panels stand below each other."""
        return self.folder is None

    @contextmanager
    def figure(
        self, name: str, title: str, rows: int, columns: int, height: float, *, solid: int | None = None
    ) -> Iterator[list[Axes]]:
        """Yield the axes of a new figure row by row; write it when the block succeeds.

        Parameters
        ----------
        height : of the wide figure [in]; panels are as high on a phone
        solid : number of the panel that has three dimensions
        """
        with mpl.rc_context(_LOOK):  # type: ignore[arg-type]
            each = height / rows
            if self.narrow:
                rows, columns = rows * columns, 1
            size = (NARROW if self.narrow else WIDE, max(each, 2.4) * rows if self.narrow else height)
            sheet = Figure(figsize=size, layout="constrained")
            FigureCanvasAgg(sheet)
            axes = [
                sheet.add_subplot(rows, columns, i + 1, projection="3d" if i == solid else None)
                for i in range(rows * columns)
            ]
            title = textwrap.fill(title, 40) if self.narrow else title
            sheet.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
            yield axes
            if self.narrow:
                for panel in axes:
                    panel.set_title(textwrap.fill(panel.get_title(loc="left"), 46))
            self._write(name, sheet)

    def _write(self, name: str, sheet: Figure) -> None:
        engine = sheet.get_layout_engine()
        assert engine is not None
        engine.execute(sheet)
        sheet.set_layout_engine(None)  # or it would be sought again for every file
        buffer = io.BytesIO()
        sheet.savefig(buffer, format="png")
        self.pictures[name] = buffer.getvalue()
        if self.folder is None:
            return
        self.files[name] = self.folder / f"{name}.png"
        with written_whole(self.files[name]) as temporary:
            temporary.write_bytes(self.pictures[name])
        with written_whole(self.folder / f"{name}.pdf") as temporary:
            # without a date the same numbers give the same file
            sheet.savefig(temporary, format="pdf", metadata={"CreationDate": None})


def colors_of(names: Iterable[str]) -> dict[str, str]:
    """Return the colour of each policy: those of the user's own have the four of `OWN` in turn."""
    own = cycle(OWN)
    return {name: COLORS[name] if name in COLORS else next(own) for name in names}


def pair(learned: xr.Dataset, optimal: xr.Dataset) -> list[tuple[xr.Dataset, str, str, str]]:
    """Return the learned record and the optimum's, each with colour, name and style of its lines."""
    return [(learned, LEARNED, "learned", "-"), (optimal, OPTIMAL, optimum_name(optimal), "--")]


def legend_above(axes: Axes) -> None:
    """Put the legend of one panel beside the title, or on a phone below, for all panels."""
    handles, labels = axes.get_legend_handles_labels()
    if _figure(axes).get_figwidth() < WIDE:
        legend_below(axes, columns=2)
        return
    axes.figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))


def legend_below(axes: Axes, columns: int, title: str | None = None) -> None:
    """Put the legend of one panel below all panels."""
    handles, labels = axes.get_legend_handles_labels()
    columns = min(columns, 2) if _figure(axes).get_figwidth() < WIDE else columns
    axes.figure.legend(handles, labels, loc="outside lower center", ncols=columns, title=title)


def _figure(axes: Axes) -> Figure:
    sheet = axes.get_figure(root=True)
    assert isinstance(sheet, Figure)
    return sheet


def time_axis(axes: Axes, end: float) -> None:
    """Label the axis of time, from 0 to `end` [s]."""
    axes.set_xlim(0.0, end)
    axes.set_xlabel("time [s]")


def line_color(index: int) -> str:
    """Return the colour of the i-th of several like lines."""
    return (*PALETTE, "#b0a18f", "#4d9de0")[index % (len(PALETTE) + 2)]
