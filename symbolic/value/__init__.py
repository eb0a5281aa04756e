"""The value function (10)-(15): bases, compiled policies, and predicted paths."""

from .basis import Basis, BasisFunction, drag, drag_cubic, find_function, quadratic
from .functions import PointTerms, ValueFunctions
from .prediction import BOUND, PredictedPath, Prediction, growing_steps
from .setup import Setup

__all__ = [
    "BOUND",
    "Basis",
    "BasisFunction",
    "PointTerms",
    "PredictedPath",
    "Prediction",
    "Setup",
    "ValueFunctions",
    "drag",
    "drag_cubic",
    "find_function",
    "growing_steps",
    "quadratic",
]
