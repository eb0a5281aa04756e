"""stationkeep: learn station keeping online, beside its certified optimum.

The names that scripts rely on; each is loaded when it is first used. The same names stay importable
from `stationkeep.symbolic`, `.online`, `.offline` and `.comparison`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .comparison import Scenario, check, compare, export, generate, replay, sweep
    from .offline import gamma_curve, saddle_gap, solve, worst_case
    from .online import Controller, simulate
    from .symbolic import Game, Model, Problem, Vehicle

_PLACES = {
    **dict.fromkeys(("Game", "Model", "Problem", "Vehicle"), "symbolic"),
    **dict.fromkeys(("Controller", "simulate"), "online"),
    **dict.fromkeys(("gamma_curve", "saddle_gap", "solve", "worst_case"), "offline"),
    **dict.fromkeys(("Scenario", "check", "compare", "export", "generate"), "comparison"),
    **dict.fromkeys(("replay", "sweep"), "comparison"),
}

__all__ = [
    "Controller",
    "Game",
    "Model",
    "Problem",
    "Scenario",
    "Vehicle",
    "__version__",
    "check",
    "compare",
    "export",
    "gamma_curve",
    "generate",
    "replay",
    "saddle_gap",
    "simulate",
    "solve",
    "sweep",
    "worst_case",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("stationkeep")
    if name not in _PLACES:
        raise AttributeError(f"module 'stationkeep' has no attribute '{name}'")
    return getattr(import_module(f".{_PLACES[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__
