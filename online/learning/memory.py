"""What a run remembers of the whole envelope: weights for later, when learning is switched off.

The critic follows the path that the vehicle is on, and forgets. Beside it, every learning step
predicts a few trajectories from states drawn in the envelope, under the remembered weights W, and
keeps their costate rows (`rows.PathRows`, relative to the whole cost of each). The fit

    argmin_W Σ_i e^{-β (t - t_i)} w_i (r_i + ω_i'W)^2 + leash Σ_l (Σ_i w_i ω_il^2) (W_l - W_ref,l)^2

is then a Gauss-Newton step on the mean of ln J over the envelope, with J the predicted cost. W goes
all, half, a quarter or a tenth of the way to it, the first that lowers the mean over validation states
of J relative to the reference policy's, or it stays. So it never becomes worse there than the linear
H-infinity policy that it starts from.

How good they become is decided by the number of paths behind a fit: a few hundred for 144 functions.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import scipy.linalg

from ...symbolic.arrays import Array
from ..rows import PathRows, draw_samples
from .safeguard import FRACTIONS, Costs

PATHS = 8  # a step
FORGETTING = 0.02  # of a step, so that a fit sees about 400 paths
EVERY = 8  # steps between two fits
N_VALIDATION = 48
LEASH = 1e-5


class Memory(Protocol):
    """What is kept beside the critic."""

    @property
    def weights(self) -> Array | None:
        """Weights for the whole envelope, shape (m,), or None."""
        ...

    def step(self) -> None:
        """Learn once more."""
        ...


class NoMemory:
    """A memory that remembers nothing."""

    weights: Array | None = None

    def step(self) -> None:
        """Do nothing."""


class EnvelopeMemory:
    """Weights that are good from the whole envelope, improved while the vehicle is elsewhere.

    Parameters
    ----------
    path_rows : rows along predicted paths, relative to the whole cost of each
    costs : predicted, under actor weights
    envelope : (n,) half-widths of the starts
    reference : (m,) weights to start from, and of the leash
    seed : of the starts

    Attributes
    ----------
    weights : (m,) W
    relative_cost : mean over the validation states of J / J of the reference
    """

    def __init__(
        self,
        path_rows: PathRows,
        costs: Costs,
        envelope: Array,
        reference: Array,
        *,
        seed: int,
    ) -> None:
        self._path_rows = path_rows
        self._costs = costs
        self._envelope = envelope
        self._reference = reference
        self._rng = np.random.default_rng([seed, 1])
        m = len(reference)
        self._matrix, self._vector = np.zeros((m, m)), np.zeros(m)
        self._n_steps = 0
        self.weights: Array = reference
        states = draw_samples(envelope, N_VALIDATION, int(self._rng.integers(2**31)))
        found = [(state, costs.cost(state, reference, reference)) for state in states]
        self._validation = [(state, cost) for state, cost in found if 0.0 < cost < np.inf]
        self.relative_cost = 1.0

    def step(self) -> None:
        """Predict more paths, and fit when it is time to."""
        self._matrix *= 1.0 - FORGETTING
        self._vector *= 1.0 - FORGETTING
        for start in draw_samples(self._envelope, PATHS, int(self._rng.integers(2**31))):
            omega, target, weight = self._path_rows.at(start[None, :], self.weights, self.weights)
            weighted = omega * weight[:, None]
            matrix, vector = weighted.T @ omega, weighted.T @ target
            # one path that is not finite would be remembered for ever
            if math.isfinite(matrix.trace() + vector @ vector):
                self._matrix += matrix
                self._vector += vector
        self._n_steps += 1
        if self._n_steps % EVERY == 0 and self._validation and self._matrix.any():
            self._improve()

    def _improve(self) -> None:
        leash = LEASH * np.diag(self._matrix) + 1e-12 * np.trace(self._matrix)
        try:
            fitted = scipy.linalg.solve(
                self._matrix + np.diag(leash), self._vector + leash * self._reference, assume_a="pos"
            )
        except np.linalg.LinAlgError:  # few paths, and rounding in them
            return
        for fraction in FRACTIONS:
            tried = self.weights + fraction * (fitted - self.weights)
            relative = self._relative_cost(tried)
            if relative < self.relative_cost:
                self.weights, self.relative_cost = tried, relative
                return

    def _relative_cost(self, weights: Array) -> float:
        """Return the mean of J / J_ref over the validation states, infinite once it can't be lower."""
        total, n = 0.0, len(self._validation)
        for state, cost in self._validation:
            total += self._costs.cost(state, weights, weights) / cost / n
            if total >= self.relative_cost:
                return np.inf
        return total
