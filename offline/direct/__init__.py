"""The direct solve: transcription, IPOPT, the structured Newton method, refinement."""

from .derivatives import PointDerivatives
from .direct import DirectSolution, DirectSolver
from .extremals import aligned_extremals, by_turns, find_extremals
from .newton import StructuredNewton
from .quick import QuickValue
from .refinement import Refined, input_errors, refine
from .second_order import SecondOrder, second_order
from .stage import Stage, against_control, against_disturbance, against_known, output_cost
from .transcription import Optimum, Transcription

__all__ = [
    "DirectSolution",
    "DirectSolver",
    "Optimum",
    "PointDerivatives",
    "QuickValue",
    "Refined",
    "SecondOrder",
    "Stage",
    "StructuredNewton",
    "Transcription",
    "against_control",
    "against_disturbance",
    "against_known",
    "aligned_extremals",
    "by_turns",
    "find_extremals",
    "input_errors",
    "output_cost",
    "refine",
    "second_order",
]
