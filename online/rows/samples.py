"""Sample points ζ_j of the rank condition (18), which replaces persistence of excitation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from ...symbolic import Path
from ...symbolic.arrays import Array

Strategy = Literal["fixed", "shrinking", "trajectory"]
Predict = Callable[[], Path]
SMALLEST = 1e-3  # scaled size below which moving samples shrink no further


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


class SampleStrategy(Protocol):
    """Where the sample points are."""

    def first(self) -> Array:
        """Return the points before the first state is known, shape (N, n)."""
        ...

    def moved(self, zeta: Array, predict: Predict) -> Array | None:
        """Return the points for the state ζ (n,), shape (N, n), or None if they stay.

        `predict` gives the predicted trajectory from ζ under the present policy, if it is asked for.
        """
        ...


@dataclass(frozen=True)
class FixedSamples:
    """The same points ζ_j, shape (N, n), all the time."""

    points: Array

    def first(self) -> Array:
        """Return the points, shape (N, n)."""
        return self.points

    def moved(self, zeta: Array, predict: Predict) -> Array | None:
        """Return None: they stay."""
        return None


@dataclass(frozen=True)
class ShrinkingSamples:
    """Points that shrink with the state: ζ_j = (1 + spread) max_i |x_i| · unit_j.

    Attributes
    ----------
    unit : (N, n) points in the full envelope
    half_widths : (n,) of it, with x = ζ / half_widths
    spread : how much farther than the state they reach
    """

    unit: Array
    half_widths: Array
    spread: float

    def first(self) -> Array:
        """Return points in the full envelope, shape (N, n)."""
        return self.unit

    def moved(self, zeta: Array, predict: Predict) -> Array | None:
        """Return the points for the state ζ (n,), shape (N, n)."""
        reach = min((1.0 + self.spread) * float(local_scale(zeta, self.half_widths)), 1.0)
        return np.asarray(reach * self.unit)


class TrajectorySamples:
    """Points around the predicted trajectory, as `around` draws them around ζ(t_j).

    The t_j are uniform on the next `ahead` seconds; new ones are drawn at every step.
    """

    def __init__(
        self, half_widths: Array, number: int, seed: int, *, spread: float, ahead: float
    ) -> None:
        self.half_widths = half_widths
        self.number = number
        self.spread = spread
        self.ahead = ahead
        self._rng = np.random.default_rng(seed)

    def first(self) -> Array:
        """Return points in the full envelope, shape (N, n)."""
        n = len(self.half_widths)
        return np.asarray(self.half_widths * self._rng.uniform(-1.0, 1.0, (self.number, n)))

    def moved(self, zeta: Array, predict: Predict) -> Array | None:
        """Return the points for the state ζ (n,), shape (N, n).

        Where the path is predicted to leave the envelope far behind, they stay around the state.
        """
        path = predict()
        times = self._rng.uniform(0.0, min(self.ahead, path.times[-1]), self.number)
        nodes = np.searchsorted(path.times, times, side="right") - 1
        centers = path.states[nodes] if np.isfinite(path.cost) else np.tile(zeta, (self.number, 1))
        return around(centers, self.half_widths, self.spread, self._rng)


def around(centers: Array, half_widths: Array, spread: float, rng: np.random.Generator) -> Array:
    """Return a point near each center, ζ + spread max_i |x_i| half_widths U(-1, 1)^n, shape (N, n)."""
    reach = spread * local_scale(centers, half_widths)[:, None] * half_widths
    return np.asarray(centers + reach * rng.uniform(-1.0, 1.0, centers.shape))
