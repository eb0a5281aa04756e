"""Measurement noise: what the policy sees instead of the state."""

from __future__ import annotations

import numpy as np

from ...symbolic.arrays import Array
from .settings import NoiseSettings


class MeasurementNoise:
    """White Gaussian noise on pose and rates, drawn anew at every measurement, seeded.

    Attributes
    ----------
    deviations : (12,) standard deviations [m, rad, m/s, rad/s]
    """

    def __init__(self, settings: NoiseSettings) -> None:
        s = settings
        self.deviations = np.repeat([s.position, s.attitude, s.velocity, s.rate], 3)
        self._rng = np.random.default_rng(s.seed)

    def measure(self, zeta: Array) -> Array:
        """Return the state with noise, shape (12,); the state itself where there is none."""
        if not self.deviations.any():
            return zeta
        return np.asarray(zeta + self.deviations * self._rng.standard_normal(12))
