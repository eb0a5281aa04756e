"""How fast a problem is, beside the shipped vehicle that the times of a comparison were chosen for."""

from __future__ import annotations

from ...symbolic import Setup, StationKeeping

DECAY = 0.117  # 1/s, of the slowest mode of the shipped game


def pace(setup: Setup) -> float:
    """Return by what to divide a time, and multiply a rate, for a problem; 1 for a vehicle."""
    return 1.0 if isinstance(setup, StationKeeping) else setup.problem.decay_rate / DECAY
