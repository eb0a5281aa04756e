"""The largest eigenvalue of a covariance, by the vector code."""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np
from scipy.linalg import lapack

from ...symbolic.arrays import Array
from .compiled import library


def largest_covariance(factor: Array) -> float | None:
    """Return λ_max of (L L')^-1 by Lanczos' method, L the lower triangle of `factor` (m, m).

    A residual r of its Ritz vector leaves an error of r^2 / gap; None when r exceeds 1e-6 λ_max after
    24 steps (10 are mostly enough), or without compiled code.
    """
    compiled = library()
    if compiled is None:
        return None
    few = _lanczos(compiled, factor, min(10, len(factor)))
    return few if few is not None else _lanczos(compiled, factor, min(24, len(factor)))


def _lanczos(compiled: ctypes.CDLL, factor: Array, steps: int) -> float | None:
    m = len(factor)
    vectors, diagonal, off = np.empty((steps + 1, m)), np.empty(steps), np.empty(steps)
    vectors[0] = _start(m)
    columns = np.asfortranarray(factor)
    pointers = (array.ctypes.data for array in (vectors, diagonal, off))
    n = compiled.inverse_lanczos(m, columns.ctypes.data, steps, *pointers)
    values, ritz, _ = lapack.dstev(diagonal[:n], off[: max(n - 1, 1)])
    if not off[n - 1] * abs(ritz[-1, -1]) <= 1e-6 * values[-1]:
        return None
    return float(values[-1])


@cache
def _start(m: int) -> Array:
    """Return a unit vector that has a part in every direction."""
    start = np.random.default_rng(m).standard_normal(m)
    return np.asarray(start / np.linalg.norm(start))
