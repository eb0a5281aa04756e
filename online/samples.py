"""Sample points ζ_j and the rank condition (18) that replaces persistence of excitation."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..symbolic.vehicle import Array


def draw_samples(half_widths: Array, n_samples: int, seed: int, *, inner: float = 0.1) -> Array:
    """Return seeded points ζ_j = half_widths · U(-1, 1)^n · U(inner, 1), shape (N, n).

    The last factor puts as many points near the origin as far away, since every run ends there.
    """
    rng = np.random.default_rng(seed)
    direction = rng.uniform(-1.0, 1.0, (n_samples, len(half_widths)))
    return half_widths * direction * rng.uniform(inner, 1.0, (n_samples, 1))


def regressor_spectrum(omega: Array) -> Array:
    """Return the eigenvalues of Σ ω_j ω_j' / p_j of (18), p_j = sqrt(1 + ω_j'ω_j), ascending, (m,)."""
    return np.asarray(np.linalg.eigvalsh(_regressor_sum(omega)))


def rank_margin(omega: Array) -> float:
    """Return λ_min(Σ ω_j ω_j' / p_j): (18) holds while it is positive.

    `omega`: (N, m) regressors at the samples. Departs from the paper: (18) asks for the rank only; a
    uniform lower bound (its c) needs the infimum of this over time, so it is followed online.
    """
    n_samples, m = omega.shape
    if n_samples < m:
        return 0.0
    least = scipy.linalg.eigvalsh(_regressor_sum(omega), subset_by_index=[0, 0])
    return float(max(least[0], 0.0))


def _regressor_sum(omega: Array) -> Array:
    normalizer = np.sqrt(1.0 + np.sum(omega * omega, axis=1))
    return np.asarray((omega / normalizer[:, None]).T @ omega)
