"""What the solver's status does not prove: re-integration by scipy, and the kinks of the drag."""

from __future__ import annotations

from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import brentq

from ...symbolic.arrays import Array
from ..limits import check
from .plant import Plant, Policy
from .trajectory import Trajectory


class Motion(Protocol):
    """States as functions of time, smooth between the mesh points."""

    @property
    def mesh(self) -> Array:
        """Interval ends, shape (K + 1,) [s]."""
        ...

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return the states (len, n) at given times, and what goes with them."""
        ...


def reintegrate(plant: Plant, zeta0: Array, path: Trajectory) -> tuple[float, float]:
    """Integrate the plant under the interpolated input, independently of the collocation.

    From ζ_0 through the whole horizon where the open-loop plant allows it; an unstable plant would
    amplify rounding by e^(λ T), so there each interval starts again from its collocated state.

    Returns
    -------
    defect : largest gap between integrated and collocated states at the mesh points, in half-widths
    value : integral of the running cost along the integrated states, with ζ(T)'P ζ(T) as the rest
    """
    A, _ = plant.problem.linearization
    chained = bool(np.linalg.eigvals(A).real.max() < 1e-6)
    collocated = path.at_mesh()
    state, cost, worst = zeta0, 0.0, 0.0
    for i, span in enumerate(pairwise(path.mesh)):
        check()
        start = state if chained else collocated[i]
        policy = _open_loop(path.input_polynomial(i))
        reached, running = plant.simulate(start, policy, np.array(span))
        state = reached[-1]
        cost += float(running[-1])
        worst = max(worst, float(np.abs((state - collocated[i + 1]) / plant.problem.scale).max()))
    return worst, cost + float(state @ plant.problem.P @ state)


def _open_loop(polynomial: BarycentricInterpolator) -> Policy:
    return lambda t, zeta: np.asarray(polynomial(t))


def sign_changes(plant: Plant, path: Motion, *, smallest: float = 1e-4, points: int = 8) -> Array:
    """Return the times at which a switching function changes sign, ascending [s].

    The functions are looked at `points` times an interval; a swing below `smallest` on either side
    is too weak to matter.
    """
    if plant.problem.switching.shape[0] == 0:
        return np.empty(0)
    times = np.unique(np.concatenate([np.linspace(a, b, points + 1) for a, b in pairwise(path.mesh)]))
    values = np.array([plant.switching(state) for state in path.sample(times)[0]])
    events = []
    for column in range(values.shape[1]):
        for i, j in _strong_crossings(values[:, column], smallest):
            events.append(_root(plant, path, column, times[i], times[j]))
    return np.sort(np.array(events))


def _strong_crossings(values: Array, smallest: float) -> list[tuple[int, int]]:
    """Return pairs i < j of different sign, at most zeros between, both lobes over `smallest`."""
    nonzero = np.flatnonzero(values)
    signs = np.sign(values[nonzero])
    crossings = np.flatnonzero(signs[:-1] != signs[1:])
    edges = [0, *(crossings + 1), len(nonzero)]
    swings = [np.abs(values[nonzero[a:b]]).max() for a, b in pairwise(edges) if b > a]
    return [
        (int(nonzero[c]), int(nonzero[c + 1]))
        for k, c in enumerate(crossings)
        if min(swings[k], swings[k + 1]) > smallest
    ]


def _root(plant: Plant, path: Motion, column: int, left: float, right: float) -> float:
    def switching(t: float) -> float:
        state = path.sample(np.array([t]))[0][0]
        return float(plant.switching(state)[column])

    return float(brentq(switching, left, right, xtol=1e-12))
