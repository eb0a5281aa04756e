"""Meshes of the time axis: graded towards t = 0, where an optimal trajectory moves fastest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...symbolic.arrays import Array


def graded_mesh(horizon: float, n_intervals: int, grading: float) -> Array:
    """Return mesh points t_i = T (e^{a i/K} - 1) / (e^a - 1), shape (K + 1,) [s].

    `grading` a is about the logarithm of the ratio of the last to the first interval; 0 is uniform.
    """
    s = np.linspace(0.0, 1.0, n_intervals + 1)
    if grading == 0.0:
        return horizon * s
    return np.asarray(horizon * (np.expm1(grading * s) / np.expm1(grading)))


def growing_mesh(horizon: float, breaks: Array, *, shortest: float, longest: float) -> Array:
    """Return mesh points on [0, T] with one at every break, (K + 1,) [s].

    After 0 and after each break the intervals grow from `shortest` by halves to `longest`.
    """
    inner = np.unique(breaks[(breaks > 0.0) & (breaks < horizon)])
    points = [0.0]
    for end in (*inner.tolist(), horizon):
        h = shortest
        while end - points[-1] > 1.5 * h:
            points.append(points[-1] + h)
            h = min(1.5 * h, longest)
        points.append(end)
    return np.array(points)


def aligned_mesh(
    mesh: Array, events: Array, *, closest: float = 0.2, fixed: Array | None = None
) -> Array:
    """Return the mesh with a point at every event, sorted.

    A mesh point nearer to an event than `closest` times the shorter of its intervals moves onto it,
    unless it is one of the `fixed`; other events split their interval.
    """
    points, taken = list(mesh), set[float]() if fixed is None else set(fixed.tolist())
    for event in np.sort(events):
        i = int(np.argmin(np.abs(np.array(points) - event)))
        neighbours = [abs(points[j] - points[i]) for j in (i - 1, i + 1) if 0 <= j < len(points)]
        inner = 0 < i < len(points) - 1 and points[i] not in taken
        if inner and abs(points[i] - event) < closest * min(neighbours):
            points[i] = float(event)
        elif points[0] < event < points[-1]:
            points = sorted({*points, float(event)})
        taken.add(float(event))
    return np.array(points)


def halved(mesh: Array, chosen: NDArray[np.bool_]) -> Array:
    """Return the mesh with the chosen intervals, (K,), cut in two."""
    middles = 0.5 * (mesh[:-1] + mesh[1:])
    return np.sort(np.append(mesh, middles[chosen]))


def extended(mesh: Array, horizon: float) -> Array:
    """Return the mesh continued to a longer horizon by intervals as long as its last."""
    last = mesh[-1] - mesh[-2]
    n_more = int(np.ceil((horizon - mesh[-1]) / last))
    return np.append(mesh, np.linspace(mesh[-1], horizon, n_more + 1)[1:])
