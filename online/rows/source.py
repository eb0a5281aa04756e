"""What a learner asks of its rows, whatever error they are of: how they are weighed, and what they say.

Either way a row is (ω, r, w) with the error δ = r + ω'Ŵ_c and the weight w, so both errors serve every
critic law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ...symbolic import ValueFunctions
from ...symbolic.arrays import Array
from ..laws import Equations, Normalizer, row_weights
from ..paper import BellmanTerms, Residual

Weights = tuple[Array, Array, Array]  # critic, actor_1, actor_2


@dataclass(frozen=True)
class RowGains:
    """η_c and the kind of the row weights.

    Attributes
    ----------
    state, samples : η_c of the row at the state and of every sample's [1/s]
    normalizer, floor : of `laws.row_weights`
    """

    state: float
    samples: float
    normalizer: Normalizer
    floor: float

    def weights(self, omega: Array, state_cost: Array) -> Array:
        """Return w of each row, without η_c, shape (N,)."""
        return row_weights(self.normalizer, omega, state_cost, self.floor)


@dataclass(frozen=True)
class Leash:
    """A ridge towards reference weights W_ref (m,), relative to what the rows know of each weight."""

    strength: float
    reference: Array

    def of(self, omega: Array, weights: Array) -> Array:
        """Return ρ (m,): the strength times Σ w ω^2 of rows ω (N, m) with weights (N,)."""
        if self.strength == 0.0:
            return np.zeros(len(self.reference))
        return np.asarray(self.strength * (weights @ omega**2))


class Observation(NamedTuple):
    """What the rows say under given weights.

    bellman_error : δ at the state (17), in units of cost per second; sample_error : rms of the relative
    error of the sample rows [-], NaN without any; equations : rows of state and samples, and the leash,
    summed
    """

    bellman_error: float
    sample_error: float
    equations: Equations


class RowSource(Protocol):
    """Where the rows come from."""

    def move(self, zeta: Array, weights: Weights) -> None:
        """Go to where rows are wanted at the state ζ (n,) under the present weights."""
        ...

    def at(self, zeta: Array, weights: Weights) -> Observation:
        """Return what is seen at ζ (n,) and where the source has gone, under the present weights."""
        ...

    def residual(self, weights: Weights) -> Residual:
        """Return ω, r and δ of the sample rows, of which there may be none."""
        ...


def terms_at(functions: ValueFunctions, points: Array) -> BellmanTerms:
    """Return the terms of (17) at the rows of `points`, shape (N, n); N may be 0."""
    game, m, k = functions.problem.game, functions.basis.n_basis, functions.problem.n_inputs
    if not len(points):
        return BellmanTerms(np.zeros(0), np.zeros((0, m)), np.zeros((0, k, m)))
    return BellmanTerms.at(points, functions.at(points), game)
