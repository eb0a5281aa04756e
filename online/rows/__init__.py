"""What the critic learns from: rows of the Bellman error (17), or of the costate error."""

from .bellman import BellmanRows, VectorBellmanRows, bellman_source
from .costate import CostateRows
from .paths import PathRows, RelativeTo
from .predictor import Predictor
from .samples import draw_samples
from .source import Leash, Observation, RowGains, RowSource, Weights, terms_at

__all__ = [
    "BellmanRows",
    "CostateRows",
    "Leash",
    "Observation",
    "PathRows",
    "Predictor",
    "RelativeTo",
    "RowGains",
    "RowSource",
    "VectorBellmanRows",
    "Weights",
    "bellman_source",
    "draw_samples",
    "terms_at",
]
