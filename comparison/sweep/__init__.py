"""Many closed-loop runs into one table."""

from .running import Swept, sweep
from .sweep import Execute, Setup, Sweep
from .sweep_plan import Plan, Run
from .sweep_run import Bench, Finished
from .sweep_summary import summary
from .vary import parse_vary

__all__ = [
    "Bench",
    "Execute",
    "Finished",
    "Plan",
    "Run",
    "Setup",
    "Sweep",
    "Swept",
    "parse_vary",
    "summary",
    "sweep",
]
