"""A comparison: every policy and the optimum from the same states."""

from .analysis import Field
from .compared_runs import Tell
from .comparison import Comparison, compared
from .excitation import ExcitationRun
from .reference import Reference
from .words import quantity, subject

__all__ = [
    "Comparison",
    "ExcitationRun",
    "Field",
    "Reference",
    "Tell",
    "compared",
    "quantity",
    "subject",
]
