"""The value function (10)-(15): bases, compiled policies, and predicted paths."""

from .basis import Basis, BasisFunction, drag, drag_cubic, find_function, quadratic
from .functions import PointTerms, ValueFunctions
from .prediction import BOUND, PredictedPath, Prediction
from .setup import Setup
from .stepping import growing_steps

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
