"""Piecewise polynomials given by their values at the points of a collocation rule."""

from __future__ import annotations

import numpy as np

from ...symbolic.arrays import Array


def interpolate(points: Array, mesh: Array, values: Array, times: Array) -> Array:
    """Return piecewise polynomials at given times, shape (len, w); exact at the points themselves.

    Parameters
    ----------
    points : (m,) where the values are on an interval, in [0, 1]
    mesh : (K + 1,) [s]
    values : (K, m, w)
    times : [s]; the first and the last polynomial go on outside the mesh
    """
    owner = np.clip(np.searchsorted(mesh, times, side="right") - 1, 0, len(mesh) - 2)
    within = (times - mesh[owner]) / (mesh[owner + 1] - mesh[owner])
    return np.asarray(np.einsum("tm,tmw->tw", _lagrange(points, within), values[owner]))


def _lagrange(points: Array, within: Array) -> Array:
    """Return the Lagrange polynomials of the points at `within`, (len, m), in barycentric form."""
    gaps = within[:, None] - points
    exact = gaps == 0.0
    terms = barycentric_weights(points) / np.where(exact, 1.0, gaps)
    hit = exact.any(axis=1)
    terms[hit] = exact[hit]  # before the division: the sum there may be 0
    return np.asarray(terms / terms.sum(axis=1, keepdims=True))


def barycentric_weights(points: Array) -> Array:
    """Return 1 / Π_{l != j} (x_j - x_l) up to a common factor, shape (m,)."""
    gaps = (points[:, None] - points) / (np.ptp(points) or 1.0) + np.eye(len(points))
    return np.asarray(1.0 / np.prod(gaps, axis=1))
