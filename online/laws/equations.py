"""Weighted rows of errors, summed to the equations that the critic laws share.

A row is (ω_i, r_i, w_i) with δ_i = r_i + ω_i'Ŵ_c. A leash (ridge towards reference weights) is m more
rows: ω = e_i, w = ρ_i, δ = Ŵ_c,i - W_ref,i.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from ...symbolic.arrays import Array
from ..paper import normalizer

Normalizer = Literal["paper", "state_cost"]


def row_weights(kind: Normalizer, omega: Array, state_cost: Array, floor: float) -> Array:
    """Return w of each row, shape (N,).

    - `paper`: 1/p with p = sqrt(1 + ω'ω), as (19) is printed; (ω/p) δ is not bounded;
    - `state_cost`: 1/(ζ'Qζ + floor)^2, so that each row is a relative error and the fast, far
      samples don't own the fit.
    """
    if kind == "state_cost":
        return np.asarray((state_cost + floor) ** -2)
    return np.asarray(1.0 / normalizer(omega))


class Equations(Protocol):
    """What either law needs of the rows."""

    @property
    def matrix(self) -> Array:
        """A = η Σ w ω ω' and the leash, shape (m, m)."""
        ...

    @property
    def gradient(self) -> Array:
        """b = η Σ w ω δ and the leash's pull at the present Ŵ_c, shape (m,)."""
        ...

    @property
    def leash(self) -> Array:
        """ρ, the part of the leash in A, shape (m,)."""
        ...

    def flow(self, dt: float) -> Array:
        """Return y(dt) of y_dot = -A y + b, y(0) = 0, shape (m,)."""
        ...


@dataclass(frozen=True)
class NormalEquations:
    """η_c Σ w ω ω' (m, m) and η_c Σ w ω δ at the present Ŵ_c (m,): all that either law needs.

    The gains η_c are in the row weights: state and samples may have different ones. The leash, ρ (m,),
    is in both.
    """

    matrix: Array
    gradient: Array
    leash: Array

    @classmethod
    def of(
        cls, omega: Array, delta: Array, weights: Array, leash: Array, offset: Array
    ) -> NormalEquations:
        """Sum the rows and the leash.

        Parameters
        ----------
        omega, delta : (N, m) regressors and (N,) Bellman errors
        weights : (N,) η_c w of each row [1/s]
        leash, offset : (m,) strengths ρ and Ŵ_c - W_ref
        """
        weighted = omega * weights[:, None]
        matrix = weighted.T @ omega
        gradient = weighted.T @ delta
        matrix[np.diag_indices_from(matrix)] += leash
        return cls(matrix, gradient + leash * offset, leash)

    def flow(self, dt: float) -> Array:
        """Return y(dt) by the eigenvalues."""
        return exact_flow(self.matrix, self.gradient, dt)


def exact_flow(matrix: Array, gradient: Array, dt: float) -> Array:
    """Return y(dt) of y_dot = -A y + b, y(0) = 0, for A >= 0 (m, m) and b (m,).

    V diag((1 - e^{-λ dt}) / λ) V' b with A = V diag(λ) V'.
    """
    eigenvalues, vectors = np.linalg.eigh(matrix)
    eigenvalues = np.maximum(eigenvalues, 0.0)
    rate = dt * eigenvalues
    # (1 - e^-x)/x -> 1 as x -> 0
    step = dt * np.where(rate > 1e-8, -np.expm1(-rate) / np.maximum(rate, 1e-8), 1.0)
    return np.asarray(vectors @ (step * (vectors.T @ gradient)))
