"""The paper's page: (13)-(21) as printed, in the paper's order.

P. Walters and W. E. Dixon, Online Approximate Optimal Station Keeping of an Autonomous Underwater
Vehicle. Every function takes many points at once: N rows of an array.

Departs from the paper: û_2 is weighed by W_d, which is the identity there; there are N samples in (18)
and (19) and m functions, where the paper also writes n and L.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..symbolic import Game, PointTerms
from ..symbolic.arrays import Array


@dataclass(frozen=True)
class BellmanTerms:
    """What the points alone decide of (14)-(17), computed once; σ' is (m, n).

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


@dataclass(frozen=True)
class Residual:
    """The Bellman error at N points: ω (N, m), which is ∂δ/∂Ŵ_c, r (N,) and δ = r + Ŵ_c'ω (N,)."""

    omega: Array
    local_cost: Array
    delta: Array

    def __len__(self) -> int:
        return len(self.delta)


def value(sigma: Array, critic: Array) -> Array:
    """Return V̂ = Ŵ_c'σ (13) from σ (N, m) and Ŵ_c (m,), shape (N,)."""
    return np.asarray(sigma @ critic)


def control_policy(terms: BellmanTerms, actor_1: Array, game: Game) -> Array:
    """Return û_1 = -1/2 R^-1 g'σ'^T Ŵ_a1 (14), shape (N, k)."""
    return np.asarray(-0.5 * (terms.sigma_g @ actor_1) @ game.R_inverse)


def disturbance_policy(terms: BellmanTerms, actor_2: Array, game: Game) -> Array:
    """Return û_2 = 1/(2 γ^2) W_d^-1 g'σ'^T Ŵ_a2 (15), shape (N, k)."""
    return np.asarray(0.5 * (terms.sigma_g @ actor_2) @ game.disturbance_inverse)


def local_cost(terms: BellmanTerms, u_1: Array, u_2: Array, game: Game) -> Array:
    """Return r(ζ, û_1, û_2) = ζ'Qζ + û_1'R û_1 - γ^2 û_2'W_d û_2 (5), shape (N,)."""
    cost = terms.state_cost + np.sum((u_1 @ game.R) * u_1, axis=1)
    if np.isfinite(game.gamma):  # without a disturbance player û_2 = 0
        cost = cost - np.sum(game.gamma**2 * (u_2 @ game.W_d) * u_2, axis=1)
    return np.asarray(cost)


def regressor(terms: BellmanTerms, u_1: Array, u_2: Array) -> Array:
    """Return ω = σ'(f + g (û_1 + û_2)), after (17), shape (N, m)."""
    return np.asarray(terms.sigma_f + ((u_1 + u_2)[:, None, :] @ terms.sigma_g)[:, 0, :])


def approximate_hamiltonian(local: Array, omega: Array, critic: Array) -> Array:
    """Return Ĥ = r + ∂V̂/∂ζ (f + g (û_1 + û_2)) = r + Ŵ_c'ω (16), shape (N,)."""
    return np.asarray(local + omega @ critic)


def bellman_error(
    terms: BellmanTerms, game: Game, critic: Array, actor_1: Array, actor_2: Array
) -> Residual:
    """Return δ = Ĥ - H with H = 0 (17), and ω and r, for Ŵ_c, Ŵ_a1 and Ŵ_a2, each (m,)."""
    u_1, u_2 = control_policy(terms, actor_1, game), disturbance_policy(terms, actor_2, game)
    local, omega = local_cost(terms, u_1, u_2, game), regressor(terms, u_1, u_2)
    return Residual(omega, local, approximate_hamiltonian(local, omega, critic))


def normalizer(omega: Array) -> Array:
    """Return p = sqrt(1 + ω'ω), after (18), shape (N,)."""
    return np.asarray(np.sqrt(1.0 + np.sum(omega * omega, axis=1)))


def regressor_spectrum(omega: Array) -> Array:
    """Return the eigenvalues of Σ ω_j ω_j' / p_j (18), ascending, shape (m,)."""
    rows = omega * (1.0 + np.sum(omega * omega, axis=1, keepdims=True)) ** -0.25  # ω / √p
    return np.asarray(np.linalg.eigvalsh(rows.T @ rows))


def rank_margin(omega: Array) -> float:
    """Return c_lower = λ_min(Σ ω_j ω_j' / p_j), after (18): the rank is m while it is positive.

    `omega`: (N, m) at the samples. It moves with the actors; a uniform c_lower is its least over a run.
    """
    n_samples, m = omega.shape
    return 0.0 if n_samples < m else float(max(regressor_spectrum(omega)[0], 0.0))


def critic_rate(here: Residual, samples: Residual, gain: float) -> Array:
    """Return Ŵ_c_dot = -η_c ω δ / p - η_c Σ ω_j δ_j / p_j (19), shape (m,); `here` is one row."""
    return np.asarray(-gain * sum(at.delta / normalizer(at.omega) @ at.omega for at in (here, samples)))


def actor_rate(actor: Array, critic: Array, gain: float, projection: Projection) -> Array:
    """Return Ŵ_a_dot = proj{-η_a (Ŵ_a - Ŵ_c)}, (20) of Ŵ_a1 and (21) of Ŵ_a2, shape (m,)."""
    return projection(actor, -gain * (actor - critic))


@dataclass(frozen=True)
class Projection:
    """proj{.} of (20)(21), continuously differentiable, onto the ball |θ| <= bound + margin.

    With p = θ'θ - θ_0^2, θ_0 = bound, ε = margin and n = 1,

        proj(μ) = μ - η_1 η_2 / (4 (ε^2 + 2 ε θ_0)^(n+1) θ_0^2) ∇p,
        η_1 = p^(n+1) if p > 0 else 0,   η_2 = ∇p'μ/2 + sqrt((∇p'μ/2)^2 + s^2).

    Inside the ball of radius θ_0 nothing changes; θ'proj(μ) <= 0 where |θ| = θ_0 + ε (Dixon, Behal,
    Dawson and Nagarkatti 2003; in this form Cai, de Queiroz and Dawson, IEEE Trans. Autom. Control
    51(1), 2006). `smoothing`: s, in the unit of θ'μ.
    """

    bound: float
    margin: float
    smoothing: float = 1e-3

    def __call__(self, theta: Array, mu: Array) -> Array:
        """Return proj(μ) at θ, both (m,)."""
        p = float(theta @ theta) - self.bound**2
        if p <= 0.0:
            return mu
        slope = float(theta @ mu)
        eta_2 = slope + np.hypot(slope, self.smoothing)
        full = (self.margin**2 + 2.0 * self.margin * self.bound) ** 2
        pull = p**2 * eta_2 / (4.0 * full * self.bound**2)
        return np.asarray(mu - pull * (2.0 * theta))

    def active(self, theta: Array) -> bool:
        """Return whether θ lies in the layer where the projection acts."""
        return float(theta @ theta) > self.bound**2
