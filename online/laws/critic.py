"""Critic laws: how Ŵ_c follows the Bellman error.

- `Gradient`, the paper's (19):  Ŵ_c_dot = -η_c Σ w_i ω_i δ_i  with w = 1/p, p = sqrt(1 + ω'ω);
- `LeastSquares`, with forgetting β and covariance Γ:
  Ŵ_c_dot = -η_c Γ Σ w_i ω_i δ_i,   Γ_dot = β Γ - η_c Γ (Σ w_i ω_i ω_i') Γ,   Γ <= Γ_max I.

Over a step dt the rows are frozen, and then both laws are solved exactly: they are stiff (the
spectrum of Σ w ω ω' spans 1e5 and more), and an explicit step small enough for the fastest direction
would leave the slowest one standing.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.linalg
from scipy.linalg import lapack

from ...symbolic.arrays import Array
from ..vector import largest_covariance
from .equations import Equations


class Critic(Protocol):
    """A critic law; a learner takes any.

    A learner does not take weights that are not finite. What a law keeps in its attributes is then put
    back too; it should hold arrays there that are replaced, not written into.
    """

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        """Return Ŵ_c after dt [s] with these rows, shape (m,).

        May raise numpy.linalg.LinAlgError where the rows can't be solved: the step is not taken.
        """
        ...


class Gradient:
    """The gradient law (19), `paper.critic_rate`, with any row weights: the flow of frozen rows."""

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        """Return Ŵ_c after dt of (19) with frozen rows, shape (m,): Ŵ_c - y(dt) of their flow."""
        return np.asarray(critic - rows.flow(dt))


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
            If the information matrix would not be finite and positive definite; it stays as it is.
        """
        fraction = min(1.0, self.covariance_norm / self.covariance_bound)
        # a late step may not forget more than the bound leaves
        decay = max(np.exp(-self.forgetting * (1.0 - fraction) * dt), fraction)
        factor = -dt * (1.0 - decay) / np.log(decay) if decay < 1.0 else dt
        # a new array: who has seen the old one keeps it
        information = decay * self.information + factor * rows.matrix
        lower, failed = lapack.dpotrf(information.T, lower=1)
        if failed or not np.isfinite(lower).all():
            raise np.linalg.LinAlgError("the information matrix is not finite and positive definite")
        self.information, self._factor = information, lower
        pull, _ = lapack.dpotrs(self._factor, rows.gradient, lower=1)
        return np.asarray(critic - factor * pull)
