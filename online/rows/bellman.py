"""The Bellman error (16)(17) at many points at once.

    û_1 = -1/2 R^-1 g'σ'^T Ŵ_a1        (14)      û_2 = 1/(2γ^2) W_d^-1 g'σ'^T Ŵ_a2        (15)
    δ = r(ζ, û_1, û_2) + Ŵ_c'ω,         ω = σ'(f + g (û_1 + û_2))                          (17)

What depends on the points alone, σ'f, σ'g and ζ'Qζ, is computed once; what depends on the weights is
a few products.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...symbolic import Game, PointTerms
from ...symbolic.arrays import Array


@dataclass(frozen=True)
class BellmanTerms:
    """The part of (17) that depends on the points and not on the weights.

    Attributes
    ----------
    state_cost : (N,) ζ'Qζ
    sigma_f : (N, m) σ'f
    sigma_g : (N, k, m) (σ'g)'
    """

    state_cost: Array
    sigma_f: Array
    sigma_g: Array

    @classmethod
    def at(cls, points: Array, terms: PointTerms, game: Game) -> BellmanTerms:
        """Evaluate at the rows of `points`, shape (N, n)."""
        return cls(
            state_cost=np.sum((points @ game.Q) * points, axis=1),
            sigma_f=np.einsum("nmi,ni->nm", terms.sigma_prime, terms.f),
            sigma_g=np.ascontiguousarray(
                np.swapaxes(terms.g, 1, 2) @ np.swapaxes(terms.sigma_prime, 1, 2)
            ),
        )

    def __len__(self) -> int:
        return len(self.state_cost)


@dataclass(frozen=True)
class Residual:
    """The Bellman error at N points, for given weights.

    Attributes
    ----------
    omega : (N, m) regressor ω, which is ∂δ/∂Ŵ_c
    local_cost : (N,) r(ζ, û_1, û_2)
    delta : (N,) δ
    """

    omega: Array
    local_cost: Array
    delta: Array


def bellman_error(
    terms: BellmanTerms, game: Game, critic: Array, actor_1: Array, actor_2: Array
) -> Residual:
    """Return δ and ω of (17) for critic weights Ŵ_c and actor weights Ŵ_a1, Ŵ_a2, each (m,)."""
    u_control = -0.5 * (terms.sigma_g @ actor_1) @ game.R_inverse
    u_disturbance = 0.5 * (terms.sigma_g @ actor_2) @ game.disturbance_inverse
    omega = terms.sigma_f + ((u_control + u_disturbance)[:, None, :] @ terms.sigma_g)[:, 0, :]
    cost = terms.state_cost + np.sum((u_control @ game.R) * u_control, axis=1)
    if np.isfinite(game.gamma):
        weighted = game.gamma**2 * (u_disturbance @ game.W_d)
        cost = cost - np.sum(weighted * u_disturbance, axis=1)
    return Residual(omega=omega, local_cost=cost, delta=cost + omega @ critic)
