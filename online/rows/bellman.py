"""Rows of the Bellman error (17) at the state and at fixed sample points."""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from ...symbolic import Game, ValueFunctions
from ...symbolic.arrays import Array
from ..laws import NormalEquations
from ..paper import BellmanTerms, Residual, bellman_error
from ..vector import library
from .source import Leash, Observation, RowGains, RowSource, Weights, terms_at
from .vector_rows import VectorRows


class BellmanRows:
    """Rows of the Bellman error by numpy, with the functions of `paper`.

    Parameters
    ----------
    functions : of problem and basis
    points : (N, n) samples ζ_j, N may be 0
    gains : of the rows
    leash : its ρ is that of the sample rows under the reference weights
    """

    def __init__(self, functions: ValueFunctions, points: Array, gains: RowGains, leash: Leash) -> None:
        self.functions, self.points, self.gains, self.leash = functions, points, gains, leash

    @cached_property
    def terms(self) -> BellmanTerms:
        """The terms of (17) at the samples."""
        return terms_at(self.functions, self.points)

    @cached_property
    def rho(self) -> Array:
        """ρ of the leash, shape (m,)."""
        if self.leash.strength == 0.0:
            return np.zeros(self.functions.basis.n_basis)
        reference = self.leash.reference
        there = self.residual((reference, reference, reference))
        return self.leash.of(there.omega, self._sample_weights(there))

    def move(self, zeta: Array, weights: Weights) -> None:
        """Stay: the points are fixed."""

    def at(self, zeta: Array, weights: Weights) -> Observation:
        """Return δ at ζ (n,), the rms of δ_j / ζ_j'Qζ_j, and the rows, summed."""
        terms = terms_at(self.functions, zeta[None, :])
        here, there = bellman_error(terms, self._game, *weights), self.residual(weights)
        state_weights = self.gains.state * self.gains.weights(here.omega, terms.state_cost)
        relative = there.delta / self.terms.state_cost
        equations = NormalEquations.of(
            np.vstack([here.omega, there.omega]),
            np.append(here.delta, there.delta),
            np.append(state_weights, self._sample_weights(there)),
            self.rho,
            weights[0] - self.leash.reference,
        )
        error = float(np.sqrt(np.mean(relative**2))) if len(there) else np.nan
        return Observation(float(here.delta[0]), error, equations)

    def residual(self, weights: Weights) -> Residual:
        """Return δ_j, r_j and ω_j of (17) at the samples."""
        return bellman_error(self.terms, self._game, *weights)

    @property
    def _game(self) -> Game:
        return self.functions.problem.game

    def _sample_weights(self, there: Residual) -> Array:
        return self.gains.samples * self.gains.weights(there.omega, self.terms.state_cost)


class VectorBellmanRows:
    """The same rows by compiled vector code.

    Parameters
    ----------
    plain : the rows by numpy, N >= 1
    compiled : the C code
    """

    def __init__(self, plain: BellmanRows, compiled: ctypes.CDLL) -> None:
        self.plain = plain
        self._vector = VectorRows(plain.functions, compiled, plain.points, plain.gains)

    def move(self, zeta: Array, weights: Weights) -> None:
        """Stay: the points are fixed."""

    def at(self, zeta: Array, weights: Weights) -> Observation:
        """Return what `BellmanRows.at` does; the equations hold until the next call."""
        return self._vector.observe(zeta, weights, self.plain.rho, self.plain.leash.reference)

    def residual(self, weights: Weights) -> Residual:
        """Return δ_j, r_j and ω_j of (17) at the samples."""
        return self.plain.residual(weights)


def bellman_source(
    functions: ValueFunctions, points: Array, gains: RowGains, leash: Leash
) -> RowSource:
    """Return the rows by vector code, or by numpy without a compiler, or without samples."""
    plain = BellmanRows(functions, points, gains, leash)
    compiled = library() if functions.compiled and len(points) else None
    return plain if compiled is None else VectorBellmanRows(plain, compiled)
