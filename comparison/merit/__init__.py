"""What a run cost, and how much more than the optimum."""

from .metrics import GameValue, RunMetrics, cost_to_date, dissipation_margin, distribution, run_metrics

__all__ = [
    "GameValue",
    "RunMetrics",
    "cost_to_date",
    "dissipation_margin",
    "distribution",
    "run_metrics",
]
