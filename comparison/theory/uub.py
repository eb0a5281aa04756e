"""The constants of the paper's UUB theorem, (24)-(31), over a stated χ.

With Z = (ζ, W̃_c, W̃_a1, W̃_a2), W̃ = W - Ŵ, and V_L = V + (|W̃_c|^2 + |W̃_a1|^2 + |W̃_a2|^2)/2,
the law (19)-(21) as printed gives, along ζ_dot = f + g (û_1 + û_2) in χ,

    V_L_dot <= -φ_ζ |ζ|^2 - φ_c |W̃_c|^2 - φ_a1 |W̃_a1|^2 - φ_a2 |W̃_a2|^2
               + κ_c |W̃_c| + κ_a1 |W̃_a1| + κ_a2 |W̃_a2| + κ,
    φ_ζ = q - η_c L_f sup|ε'| e/2,   φ_ai = η_ai/2,
    φ_c = η_c (c - L_f sup|ε'|/(2 e)) - (η_a1 + η_a2)/2,

with the proof's free e > 0, so V_L_dot < 0 where |Z| > K. Departures from what is printed:

- κ's G is G_1 - G_2;
- κ_c: each sample's term is multiplied by its own ω_j/p_j, so the terms can't cancel as printed; the
  norms are summed here, with |ω/p| <= 1;
- (31): completing squares gives V_L_dot <= -α_5 |Z|^2 + α_5 K^2, so -(α_5/2) |Z|^2 needs |Z| >= √2 K;
- that Z gets below K does not say that it stays there: the ultimate bound is α_3^-1(α_4(K)).

Even with ε = 0 the printed K is not 0: κ_ai bounds V_ζ G_i σ'^T / 2 by its supremum over χ, and κ_c the
quadratic terms by the projection's ball, although both vanish at Z = 0; see `exact_basis`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...online.paper import BellmanTerms, bellman_error
from ...symbolic import Game, ValueFunctions
from ...symbolic.arrays import Array


@dataclass(frozen=True)
class Knowledge:
    """The true value at points of χ, and the ideal weights of a basis there.

    Attributes
    ----------
    weights : (m,) W
    points : (M, n) of χ
    values, gradients : (M,) V and (M, n) V_ζ at the points
    """

    weights: Array
    points: Array
    values: Array
    gradients: Array


@dataclass(frozen=True)
class Gains:
    """η_c, η_a1 and η_a2 of (19)-(21)."""

    critic: float
    actor_1: float
    actor_2: float


@dataclass(frozen=True)
class Suprema:
    """What the proof takes the largest value of, as the points of χ show it: lower bounds of suprema.

    Attributes
    ----------
    q_lower : λ_min(Q)
    drift : L_f = sup |f| / |ζ|
    epsilon_prime : sup |ε'|
    square_1, square_2 : sup_χ λ_max(G_σi) + Σ_j λ_max(G_σij), s_i
    rest : sup_χ |ε'Gσ'^T W / 2 + ε'Gε'^T / 4| + Σ_j |E_j|
    kappa_a1, kappa_a2, kappa : sup |V_ζ G_i σ'^T| / 2, sup |ε'Gε'^T| / 4
    value_lower, value_upper : least and largest V / |ζ|^2
    """

    q_lower: float
    drift: float
    epsilon_prime: float
    square_1: float
    square_2: float
    rest: float
    kappa_a1: float
    kappa_a2: float
    kappa: float
    value_lower: float
    value_upper: float

    @property
    def class_k(self) -> float:
        """sqrt(α_4 / α_3) of (28): both are |Z|^2 times a constant, least and largest of V_L's."""
        return float(np.sqrt(max(self.value_upper, 0.5) / min(self.value_lower, 0.5)))


@dataclass(frozen=True)
class Constants:
    """The constants of (31) for some gains.

    Attributes
    ----------
    free : e, which the proof leaves free; the geometric mean of what (24) and (25) admit, and half of
        what (24) does where no e satisfies (25)
    phi_zeta, phi_c, phi_a1, phi_a2 : φ; the theorem needs all of them positive
    kappa_c : of the module's docstring
    alpha_5 : min(φ_ζ, φ_c/2, φ_a1/2, φ_a2/2)
    parts : what each of κ_c, κ_a1, κ_a2 and κ adds to K^2, printed; infinite without α_5 > 0
    """

    free: float
    phi_zeta: float
    phi_c: float
    phi_a1: float
    phi_a2: float
    kappa_c: float
    alpha_5: float
    parts: dict[str, float]

    @property
    def radius_printed(self) -> float:
        """K as printed: outside this ball V_L falls."""
        return float(np.sqrt(sum(self.parts.values())))

    @property
    def radius(self) -> float:
        """√2 K: outside this ball V_L_dot <= -(α_5/2) |Z|^2."""
        return float(np.sqrt(2.0)) * self.radius_printed


def measure(
    functions: ValueFunctions, known: Knowledge, samples: Array, drift: float | None = None
) -> Suprema:
    """Return the suprema over the known points, and the sums over the samples ζ_j, shape (N, n).

    `drift`: L_f, where it was measured on more points.
    """
    game, points = functions.problem.game, known.points
    found = functions.at(points)
    f, slope = found.f.copy(), np.einsum("pmn,m->pn", found.sigma_prime, known.weights)
    push_true = np.einsum("pnk,pn->pk", found.g, known.gradients)
    push_error = push_true - np.einsum("pnk,pn->pk", found.g, slope)
    terms = BellmanTerms.at(points, found, game)
    size = np.sum(points**2, axis=1)
    cross = [
        0.5 * np.linalg.norm(np.einsum("pk,pkm->pm", push_true @ weight, terms.sigma_g), axis=1)
        for weight in _weights(game)
    ]
    eff = game.R_eff_inverse
    quarter = 0.25 * np.einsum("pk,kl,pl->p", push_error, eff, push_error)
    half = 0.5 * np.einsum("pk,kl,pl->p", push_error, eff, push_true - push_error)
    squares, residual = _at_samples(functions, known.weights, samples)
    here = [float(largest_square(terms, weight).max()) for weight in _weights(game)]
    measured = float((np.linalg.norm(f, axis=1) / np.sqrt(size)).max())
    return Suprema(
        q_lower=float(np.linalg.eigvalsh(game.Q)[0]),
        drift=measured if drift is None else max(drift, measured),
        epsilon_prime=float(np.linalg.norm(known.gradients - slope, axis=1).max()),
        square_1=here[0] + squares[0],
        square_2=here[1] + squares[1],
        rest=float(np.abs(half + quarter).max()) + residual,
        kappa_a1=float(cross[0].max()),
        kappa_a2=float(cross[1].max()),
        kappa=float(np.abs(quarter).max()),
        value_lower=float((known.values / size).min()),
        value_upper=float((known.values / size).max()),
    )


def largest_square(terms: BellmanTerms, weight: Array) -> Array:
    """Return λ_max(σ' g R^-1 g' σ'^T) at points, with R^-1 (k, k) as `weight`, shape (N,)."""
    half = np.linalg.cholesky(weight).T @ terms.sigma_g
    return np.asarray(np.linalg.eigvalsh(half @ np.swapaxes(half, 1, 2))[:, -1])


def constants(found: Suprema, gains: Gains, c_lower: float, weight_error: float) -> Constants:
    """Return the theorem's constants.

    Parameters
    ----------
    c_lower : infimum of λ_min of (18)'s sum over the run
    weight_error : bound of |W̃_a1| and |W̃_a2|
    """
    half_actors = 0.5 * (gains.actor_1 + gains.actor_2)
    product = found.drift * found.epsilon_prime
    free = _free(found.q_lower, gains.critic * product, product, c_lower - half_actors / gains.critic)
    phi_zeta = found.q_lower - 0.5 * gains.critic * product * free
    phi_c = gains.critic * (c_lower - (0.5 * product / free if product else 0.0)) - half_actors
    phi_a1, phi_a2 = 0.5 * gains.actor_1, 0.5 * gains.actor_2
    squares = 0.25 * max(found.square_1, found.square_2) * weight_error**2
    kappa_c = gains.critic * (squares + found.rest)
    alpha_5 = min(phi_zeta, 0.5 * phi_c, 0.5 * phi_a1, 0.5 * phi_a2)
    tops = {
        "κ_c": (kappa_c, phi_c),
        "κ_a1": (found.kappa_a1, phi_a1),
        "κ_a2": (found.kappa_a2, phi_a2),
    }
    parts = {name: _part(k**2, 2.0 * phi, alpha_5) for name, (k, phi) in tops.items()}
    parts["κ"] = _part(found.kappa, 1.0, alpha_5)
    return Constants(free, phi_zeta, phi_c, phi_a1, phi_a2, kappa_c, alpha_5, parts)


def admissible_gains(found: Suprema, c_lower: float) -> Gains:
    """Return gains that (24) and (25) admit, half way: φ_ζ = q/2 and φ_c = η_c c/4.

    η_a1 = η_a2 = η_c c/4 and e = L_f sup|ε'| / c, so η_c = q c / (L_f sup|ε'|)^2; 1 without ε'.
    """
    product = found.drift * found.epsilon_prime
    critic = found.q_lower * c_lower / product**2 if product else 1.0
    return Gains(critic, 0.25 * critic * c_lower, 0.25 * critic * c_lower)


def lyapunov(
    values: Array, errors: tuple[Array, Array, Array], information: Array | None = None
) -> Array:
    """Return V_L of (27) from V, (T,), and W̃_c, W̃_a1 and W̃_a2, (T, m) each, shape (T,).

    `information`: Γ^-1 of least squares, (T, m, m), for which |W̃_c|^2 becomes W̃_c'Γ^-1 W̃_c. Without
    the actors' part that falls at the rate η_c W̃_c'Λ W̃_c + β W̃_c'Γ^-1 W̃_c, halved.
    """
    critic, *actors = errors
    weighted = critic if information is None else np.einsum("tij,tj->ti", information, critic)
    squares = np.sum(critic * weighted, axis=1) + sum(np.sum(error**2, axis=1) for error in actors)
    return np.asarray(values + 0.5 * squares)


def distance(zeta: Array, errors: tuple[Array, Array, Array]) -> Array:
    """Return |Z| from ζ, (T, n), and W̃_c, W̃_a1 and W̃_a2, (T, m) each, shape (T,)."""
    squares = np.sum(zeta**2, axis=1) + sum(np.sum(error**2, axis=1) for error in errors)
    return np.asarray(np.sqrt(squares))


def _weights(game: Game) -> tuple[Array, Array]:
    """Return R^-1 and γ^-2 W_d^-1, the weights of G_1 and G_2."""
    return game.R_inverse, game.disturbance_inverse


def _at_samples(
    functions: ValueFunctions, weights: Array, samples: Array
) -> tuple[tuple[float, float], float]:
    """Return Σ λ_max(G_σij) for both players and Σ |E_j|; E_j is δ_j at the ideal weights."""
    if not len(samples):
        return (0.0, 0.0), 0.0
    game = functions.problem.game
    terms = BellmanTerms.at(samples, functions.at(samples), game)
    first, second = (float(largest_square(terms, weight).sum()) for weight in _weights(game))
    ideal = bellman_error(terms, game, weights, weights, weights)
    return (first, second), float(np.abs(ideal.delta).sum())


def _free(q_lower: float, gained: float, product: float, room: float) -> float:
    """Return e between the least of (25), product / (2 room), and the largest of (24)."""
    if product == 0.0:
        return 1.0
    largest = 2.0 * q_lower / gained
    return float(np.sqrt(largest * product / (2.0 * room))) if room > 0.0 else 0.5 * largest


def _part(numerator: float, phi: float, alpha: float) -> float:
    return numerator / (phi * alpha) if alpha > 0.0 else np.inf
