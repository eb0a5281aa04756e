"""Actor laws (20)(21) and the smooth projection that keeps their weights in a ball."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...symbolic.arrays import Array


@dataclass(frozen=True)
class Projection:
    """Continuously differentiable projection onto the ball |θ| <= bound + margin.

    With p = θ'θ - θ_0^2, θ_0 = bound, ε = margin and n = 1,

        proj(μ) = μ - η_1 η_2 / (4 (ε^2 + 2 ε θ_0)^(n+1) θ_0^2) ∇p,
        η_1 = p^(n+1) if p > 0 else 0,   η_2 = ∇p'μ/2 + sqrt((∇p'μ/2)^2 + s^2).

    Inside the ball of radius θ_0 nothing changes; θ'proj(μ) <= 0 where |θ| = θ_0 + ε (Dixon, Behal,
    Dawson and Nagarkatti 2003; in this form Cai, de Queiroz and Dawson, IEEE Trans. Autom. Control
    51(1), 2006).

    Attributes
    ----------
    bound : θ_0
    margin : ε
    smoothing : s, in the unit of θ'μ
    """

    bound: float
    margin: float
    smoothing: float = 1e-3

    def __call__(self, theta: Array, mu: Array) -> Array:
        """Return proj(μ) at θ, both (m,)."""
        p = float(theta @ theta) - self.bound**2
        if p <= 0.0:
            return mu
        slope = float(theta @ mu)
        eta_2 = slope + np.hypot(slope, self.smoothing)
        full = (self.margin**2 + 2.0 * self.margin * self.bound) ** 2
        pull = p**2 * eta_2 / (4.0 * full * self.bound**2)
        return np.asarray(mu - pull * (2.0 * theta))

    def active(self, theta: Array) -> bool:
        """Return whether θ lies in the layer where the projection acts."""
        return float(theta @ theta) > self.bound**2


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
