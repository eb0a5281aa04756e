"""What a learner of the costate error sees: rows along paths from the state and from around it."""

from __future__ import annotations

import numpy as np

from ...symbolic import ValueFunctions
from ...symbolic.arrays import Array
from ..laws import NormalEquations
from ..paper import Residual, bellman_error
from .paths import PathRows
from .samples import around
from .source import Leash, Observation, Weights, terms_at


class CostateRows:
    """Rows of the costate error along paths from the state and from around it.

    Parameters
    ----------
    functions : of problem and basis; x = ζ / half-widths
    path_rows : of the predicted paths
    gain : η_c of every row [1/s]
    leash : its ρ is that of the rows of the moment
    paths : how many; the first starts at the state, the others around it
    spread : of the other starts, as a part of max_i |x_i|
    seed : of their directions, new ones at every step
    """

    def __init__(
        self,
        functions: ValueFunctions,
        path_rows: PathRows,
        gain: float,
        leash: Leash,
        *,
        paths: int,
        spread: float,
        seed: int,
    ) -> None:
        self._functions, self._path_rows = functions, path_rows
        self._gain, self._leash = gain, leash
        self._paths, self._spread = paths, spread
        self._rng = np.random.default_rng(seed)
        self._omega, self._target, self._spans = path_rows.none()

    def move(self, zeta: Array, weights: Weights) -> None:
        """Predict the paths and their costates under the present actors."""
        centers = np.tile(zeta, (self._paths - 1, 1))
        half_widths = self._functions.problem.scale
        starts = np.vstack([zeta, around(centers, half_widths, self._spread, self._rng)])
        self._omega, self._target, self._spans = self._path_rows.at(starts, *weights[1:])

    def at(self, zeta: Array, weights: Weights) -> Observation:
        """Return δ at ζ (n,), the root of the relative regret, and the rows of the paths, summed.

        δ is for the record: the critic learns from the paths alone.
        """
        terms, game = terms_at(self._functions, zeta[None, :]), self._functions.problem.game
        here, there = bellman_error(terms, game, *weights), self.residual(weights)
        row_weights = self._gain * self._spans
        equations = NormalEquations.of(
            there.omega,
            there.delta,
            row_weights,
            self._leash.of(there.omega, row_weights),
            weights[0] - self._leash.reference,
        )
        error = float(np.sqrt(self._spans @ there.delta**2)) if len(there) else np.nan
        return Observation(float(here.delta[0]), error, equations)

    def residual(self, weights: Weights) -> Residual:
        """Return the costate error of the rows under the present critic."""
        delta = self._omega @ weights[0] - self._target
        return Residual(omega=self._omega, local_cost=-self._target, delta=delta)
