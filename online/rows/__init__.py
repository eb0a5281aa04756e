"""What the critic learns from: rows of the Bellman error (17), or of the costate error."""

from .bellman import BellmanTerms, Residual, bellman_error
from .samples import (
    FixedSamples,
    SampleStrategy,
    ShrinkingSamples,
    Strategy,
    TrajectorySamples,
    draw_samples,
    rank_margin,
    regressor_spectrum,
)
from .sources import BellmanSource, CostateSource, PathRows, RelativeTo, RowSource, SampleRows, Weights
from .vector_rows import RowGains, VectorRows

__all__ = [
    "BellmanSource",
    "BellmanTerms",
    "CostateSource",
    "FixedSamples",
    "PathRows",
    "RelativeTo",
    "Residual",
    "RowGains",
    "RowSource",
    "SampleRows",
    "SampleStrategy",
    "ShrinkingSamples",
    "Strategy",
    "TrajectorySamples",
    "VectorRows",
    "Weights",
    "bellman_error",
    "draw_samples",
    "rank_margin",
    "regressor_spectrum",
]
