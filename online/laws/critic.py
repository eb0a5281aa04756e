"""Critic laws: how Ŵ_c follows the Bellman error.

All are laws for weighted rows (ω_i, r_i, w_i) with δ_i = r_i + ω_i'Ŵ_c:

- `gradient`, the paper's (19):  Ŵ_c_dot = -η_c Σ w_i ω_i δ_i  with w = 1/p, p = sqrt(1 + ω'ω);
- `least_squares`, with forgetting β and covariance Γ:
  Ŵ_c_dot = -η_c Γ Σ w_i ω_i δ_i,   Γ_dot = β Γ - η_c Γ (Σ w_i ω_i ω_i') Γ,   Γ <= Γ_max I.

Over a step dt the rows are frozen, and then both laws are solved exactly: they are stiff (the
spectrum of Σ w ω ω' spans 1e5 and more), and an explicit step small enough for the fastest direction
would leave the slowest one standing.

A leash (ridge towards reference weights) is m more rows: ω = e_i, w = ρ_i, δ = Ŵ_c,i - W_ref,i.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import scipy.linalg
from scipy.linalg import lapack

from ...symbolic.arrays import Array
from ..paper import normalizer
from .vector_code import largest_covariance

Normalizer = Literal["paper", "squared", "state_cost"]


def row_weights(kind: Normalizer, omega: Array, state_cost: Array, floor: float) -> Array:
    """Return w of each row, shape (N,).

    - `paper`: 1/p with p = sqrt(1 + ω'ω), as (19) is printed; (ω/p) δ is not bounded;
    - `squared`: 1/p^2, which bounds it;
    - `state_cost`: 1/(ζ'Qζ + floor)^2, so that each row is a relative error and the fast, far
      samples don't own the fit.
    """
    if kind == "state_cost":
        return np.asarray((state_cost + floor) ** -2)
    p = normalizer(omega)
    return np.asarray(1.0 / p if kind == "paper" else p**-2)


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


def gradient_step(critic: Array, rows: Equations, dt: float) -> Array:
    """Return Ŵ_c after dt of (19) with frozen rows, shape (m,): Ŵ_c - y(dt) of their flow."""
    return np.asarray(critic - rows.flow(dt))


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


class LeastSquares:
    """Recursive least squares with forgetting; the state is the information matrix Γ^-1.

    With frozen rows over dt the law is solved exactly by
    Γ^-1 <- e^{-β dt} Γ^-1 + c η Σ w ω ω',  Ŵ_c <- Ŵ_c - Γ c η Σ w ω δ,  c = (1 - e^{-β dt}) / β,
    so Ŵ_c minimises ∫ η e^{-β(t-s)} Σ w (r + ω'W)^2 ds + e^{-βt} (W - Ŵ_c(0))'Γ(0)^-1 (W - Ŵ_c(0)).

    The covariance is kept below Γ_max by the bounded-gain forgetting of Slotine and Li (1991, sec.
    8.7.6): β is replaced by β (1 - λ_max(Γ) / Γ_max), and a late step forgets no more than the bound
    leaves.

    Parameters
    ----------
    n_basis : number of weights m
    forgetting : β [1/s]
    covariance : Γ(0) as a multiple of the identity
    covariance_bound : Γ_max, at least Γ(0)
    """

    def __init__(
        self, n_basis: int, forgetting: float, covariance: float, covariance_bound: float
    ) -> None:
        self.forgetting = forgetting
        self.covariance_bound = covariance_bound
        self.information = np.eye(n_basis) / covariance
        self._factor = np.eye(n_basis) / np.sqrt(covariance)

    @property
    def covariance_norm(self) -> float:
        """λ_max(Γ), the largest eigenvalue of the covariance."""
        found = largest_covariance(self._factor)
        if found is not None:
            return found
        least = scipy.linalg.eigvalsh(self.information, subset_by_index=[0, 0])
        return float(1.0 / max(least[0], np.finfo(float).tiny))

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        """Return Ŵ_c after dt with frozen rows, shape (m,), and update the covariance.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the information matrix is not positive definite.
        """
        fraction = min(1.0, self.covariance_norm / self.covariance_bound)
        # a late step may not forget more than the bound leaves
        decay = max(np.exp(-self.forgetting * (1.0 - fraction) * dt), fraction)
        factor = -dt * (1.0 - decay) / np.log(decay) if decay < 1.0 else dt
        # a new array: who has seen the old one keeps it
        self.information = decay * self.information + factor * rows.matrix
        self._factor, failed = lapack.dpotrf(self.information.T, lower=1)
        if failed:
            raise np.linalg.LinAlgError("the information matrix is not positive definite")
        pull, _ = lapack.dpotrs(self._factor, rows.gradient, lower=1)
        return np.asarray(critic - factor * pull)
