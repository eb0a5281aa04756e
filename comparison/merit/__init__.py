"""What a run cost, how much more than the optimum, and how that is distributed over many runs."""

from .cost import cost_to_date, cost_to_go, dissipation_margin, game_cost
from .metrics import RunMetrics, run_metrics
from .regrets import QUANTILES, Regret, finite, regret
from .value import FINE, GameValue

__all__ = [
    "FINE",
    "QUANTILES",
    "GameValue",
    "Regret",
    "RunMetrics",
    "cost_to_date",
    "cost_to_go",
    "dissipation_margin",
    "finite",
    "game_cost",
    "regret",
    "run_metrics",
]
