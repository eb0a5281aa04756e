"""Sample points ζ_j of the rank condition (18), which replaces persistence of excitation."""

from __future__ import annotations

import numpy as np

from ...symbolic.arrays import Array

SMALLEST = 1e-3  # scaled size of the state below which points around it draw no closer


def draw_samples(half_widths: Array, n_samples: int, seed: int, *, inner: float = 0.1) -> Array:
    """Return seeded points ζ_j = half_widths · U(-1, 1)^n · U(inner, 1), shape (N, n).

    The last factor puts as many points near the origin as far away, since every run ends there.
    """
    rng = np.random.default_rng(seed)
    direction = rng.uniform(-1.0, 1.0, (n_samples, len(half_widths)))
    return half_widths * direction * rng.uniform(inner, 1.0, (n_samples, 1))


def local_scale(points: Array, half_widths: Array) -> Array:
    """Return max_i |x_i| of scaled states x = ζ / half_widths, between 1e-3 and 1, shape (N,)."""
    return np.asarray(np.clip(np.abs(points / half_widths).max(axis=-1), SMALLEST, 1.0))


def around(centers: Array, half_widths: Array, spread: float, rng: np.random.Generator) -> Array:
    """Return a point near each center, ζ + spread max_i |x_i| half_widths U(-1, 1)^n, shape (N, n)."""
    reach = spread * local_scale(centers, half_widths)[:, None] * half_widths
    return np.asarray(centers + reach * rng.uniform(-1.0, 1.0, centers.shape))
