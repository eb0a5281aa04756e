"""Many closed-loop runs into one table."""

from .running import SweepResult, sweep
from .sweep import Execute, Setup, Sweep
from .sweep_plan import Plan, Run
from .sweep_run import FinishedRun, WorkerSettings
from .sweep_summary import summary
from .vary import parse_vary

__all__ = [
    "Execute",
    "FinishedRun",
    "Plan",
    "Run",
    "Setup",
    "Sweep",
    "SweepResult",
    "WorkerSettings",
    "parse_vary",
    "summary",
    "sweep",
]
