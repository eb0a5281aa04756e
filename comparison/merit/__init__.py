"""What a run cost, how much more than the optimum, and how that is distributed over many runs."""

from .cost import cost_to_date, cost_to_go, dissipation_margin, game_cost
from .learning import learning_fault
from .metrics import RunMetrics, run_metrics
from .regrets import QUANTILES, Regret, below_optimum, finite, regret

__all__ = [
    "QUANTILES",
    "Regret",
    "RunMetrics",
    "below_optimum",
    "cost_to_date",
    "cost_to_go",
    "dissipation_margin",
    "finite",
    "game_cost",
    "learning_fault",
    "regret",
    "run_metrics",
]
