"""What the critic learns from: rows of the Bellman error (17), or of the costate error."""

from .samples import (
    FixedSamples,
    SampleStrategy,
    ShrinkingSamples,
    Strategy,
    TrajectorySamples,
    draw_samples,
)
from .sources import BellmanSource, CostateSource, PathRows, RelativeTo, RowSource, SampleRows, Weights
from .vector_rows import RowGains, VectorRows

__all__ = [
    "BellmanSource",
    "CostateSource",
    "FixedSamples",
    "PathRows",
    "RelativeTo",
    "RowGains",
    "RowSource",
    "SampleRows",
    "SampleStrategy",
    "ShrinkingSamples",
    "Strategy",
    "TrajectorySamples",
    "VectorRows",
    "Weights",
    "draw_samples",
]
