"""What a problem, its states and its inputs are called in figures, tables and sentences."""

from __future__ import annotations

from ...symbolic import Setup, StationKeeping


def subject(setup: Setup) -> str:
    """Return what moves, to stand after "the": vehicle, or the name of another problem."""
    return "vehicle" if isinstance(setup, StationKeeping) else setup.problem.name


def quantity(name: str, unit: str) -> str:
    """Return a name with its unit in brackets, without them where the unit is 1."""
    return name if unit == "1" else f"{name} [{unit}]"
