"""The learner's vector code, compiled, and the largest eigenvalue of a covariance by it."""

from __future__ import annotations

import ctypes
from functools import cache
from importlib import resources

import numpy as np
from scipy.linalg import lapack

from ...symbolic.arrays import Array
from ...symbolic.compiled import (
    NATIVE_FLAGS,
    WITHOUT_COMPILER,
    CompilationError,
    compile_source,
    say_once,
)


@cache
def _library() -> ctypes.CDLL:
    """Return the compiled code; raises CompilationError."""
    source = resources.files(__package__).joinpath("vector_rows.c").read_text(encoding="utf-8")
    path = compile_source(source, NATIVE_FLAGS).path
    try:
        library = ctypes.CDLL(str(path))
        pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_longlong
        library.bellman.argtypes = [pointer] * 5
        library.flow.argtypes = [pointer] * 3 + [number] * 2 + [pointer] * 2
        library.normal.argtypes = [pointer] * 2
        library.inverse_lanczos.argtypes = [integer, pointer, integer, *[pointer] * 3]
        library.flow.restype = library.inverse_lanczos.restype = integer
    except (OSError, AttributeError):
        raise CompilationError("what the C compiler built can't be loaded") from None
    return library


def library() -> ctypes.CDLL | None:
    """Return the compiled code, or None where it can't be compiled, which is said once."""
    try:
        return _library()
    except CompilationError as error:
        say_once(f"{error}; {WITHOUT_COMPILER}")
        return None


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
