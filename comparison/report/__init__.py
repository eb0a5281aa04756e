"""Figures, films and the report of a comparison."""

from .animation import animate
from .figures import draw_all
from .gamma_figure import draw_gamma_curves
from .report import write_report
from .report_tables import CLAIRVOYANT_CHECK, certificate, clairvoyant_check, summary, too_short
from .style import Page

__all__ = [
    "CLAIRVOYANT_CHECK",
    "Page",
    "animate",
    "certificate",
    "clairvoyant_check",
    "draw_all",
    "draw_gamma_curves",
    "summary",
    "too_short",
    "write_report",
]
