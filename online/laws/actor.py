"""Actor laws (20)(21) over a step."""

from __future__ import annotations

import math

import numpy as np

from ...symbolic.arrays import Array
from ..paper import Projection


def actor_step(actor: Array, critic: Array, gain: float, dt: float, projection: Projection) -> Array:
    """Return Ŵ_a after dt of (20) or (21): Ŵ_a_dot = proj{-η_a (Ŵ_a - Ŵ_c)}, shape (m,).

    With a frozen critic the law without projection is solved exactly; its mean rate over the step is
    projected. The ball is convex, so pulling the end point back to it (what a finite step overshoots
    is of second order in dt) never moves it away from weights inside.
    """
    mean_rate = -math.expm1(-gain * dt) / dt * (critic - actor)
    moved = actor + dt * projection(actor, mean_rate)
    outer = projection.bound + projection.margin
    norm = math.sqrt(moved @ moved)
    return np.asarray(moved if norm <= outer else moved * (outer / norm))
