"""The paper's assumptions and conditions, each with its number for a scenario.

Conditions that need numbers which don't exist yet (ε' of Assumption 3) have the value None and say so;
where a part of such a bound is known, the bound is that part and the note says what is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..online import Learner, draw_samples
from ..online.samples import regressor_spectrum
from ..symbolic import StationKeeping
from .scenario import Scenario

NO_EPSILON = "needs sup|ε'| of Assumption 3, which takes ideal weights from certified values"


@dataclass(frozen=True)
class Condition:
    """One line of `check`.

    Attributes
    ----------
    name : what must hold
    paper : where the paper says so
    value, bound : the two sides; None if not known
    holds : None if it can't be decided
    note : what the numbers are, and what is missing
    """

    name: str
    paper: str
    value: float | None
    bound: float | None
    holds: bool | None
    note: str


def check(scenario: Scenario) -> list[Condition]:
    """Return every assumption and condition of the paper with its value for the scenario."""
    station = scenario.station_keeping()
    samples = scenario.samples
    points = draw_samples(station.envelope, samples.number, samples.seed, inner=samples.inner)
    learner = Learner(
        station.problem,
        station.basis,
        scenario.learner,
        points,
        station.riccati_weights,
        scenario.initial_weights(),
        station.functions,
    )
    return [
        _pitch(scenario),
        *_inertia(scenario, station),
        _equilibrium(station),
        _representation(),
        *_samples(scenario, learner),
        *_gains(scenario, station, learner),
        *_attenuation(station),
    ]


def _pitch(scenario: Scenario) -> Condition:
    limit = scenario.simulation.pitch_limit
    return Condition(
        "pitch stays away from ±90 deg",
        "Assumption 1",
        limit,
        90.0,
        limit < 90.0,
        "deg; a run ends when |pitch| exceeds the limit",
    )


def _inertia(scenario: Scenario, station: StationKeeping) -> list[Condition]:
    low, high = inertia_bounds(station, np.radians(scenario.simulation.pitch_limit))
    where = f"over |pitch| <= {scenario.simulation.pitch_limit:g} deg and all rolls"
    return [
        Condition(
            "M_bar >= m_lower > 0",
            "Property 1",
            low,
            0.0,
            low > 0.0,
            f"smallest eigenvalue of M_bar {where}; not constant as printed: 0 at 90 deg",
        ),
        Condition(
            "M_bar <= m_upper",
            "Property 1",
            high,
            None,
            bool(np.isfinite(high)),
            f"largest eigenvalue of M_bar {where}; |g| <= 1/m_lower = {1.0 / low:.3g} there",
        ),
    ]


def inertia_bounds(station: StationKeeping, pitch_limit: float) -> tuple[float, float]:
    """Return the least and largest eigenvalue of M_bar over |θ| <= pitch_limit [rad] and all rolls.

    On a grid of 61 pitches and 48 rolls; M_bar turns with the yaw, which leaves its eigenvalues alone.
    """
    kernel = station.model.earth_frame
    low, high = np.inf, 0.0
    zeta = np.zeros(12)
    for theta in np.linspace(-pitch_limit, pitch_limit, 61):
        for phi in np.linspace(-np.pi, np.pi, 48, endpoint=False):
            zeta[3:5] = phi, theta
            eigenvalues = np.linalg.eigvalsh(kernel(zeta)[0])
            low, high = min(low, float(eigenvalues[0])), max(high, float(eigenvalues[-1]))
    return low, high


def _equilibrium(station: StationKeeping) -> Condition:
    residual = float(np.linalg.norm(station.model.drift(np.zeros(12))))
    trim = np.array2string(station.model.u_trim, precision=3, suppress_small=True)
    note = "|f(0)|; neutrally buoyant, upright at rest"
    if residual >= 1e-9:
        note = f"|f(0)|; the steady trim u_trim = {trim} N, N m is fed forward and taken out of f"
    return Condition("f(0) = 0", "Assumption 2", residual, 0.0, residual < 1e-9, note)


def _representation() -> Condition:
    return Condition(
        "V = W'σ + ε with bounded ε, ε'",
        "Assumption 3",
        None,
        None,
        None,
        "σ is smooth, so bounded on χ, though not on R^12 as printed; sup|ε| and sup|ε'| take ideal "
        "weights from certified values",
    )


def _samples(scenario: Scenario, learner: Learner) -> list[Condition]:
    residual = learner.sample_residual()
    m = learner.basis.n_basis
    if residual is None:
        none = "there are no samples; give samples.number"
        return [Condition("rank of (18) is m", "(18), Assumption 4", 0.0, float(m), False, none)]
    spectrum = regressor_spectrum(residual.omega)
    rank = float(np.sum(spectrum > m * np.finfo(float).eps * spectrum[-1]))
    normalized = np.linalg.norm(residual.omega, axis=1)
    normalized /= np.sqrt(1.0 + normalized**2)
    return [
        Condition(
            "rank of (18) is m",
            "(18), Assumption 4",
            rank,
            float(m),
            rank == m,
            f"{scenario.samples.number} samples at the initial weights; printed as L",
        ),
        Condition(
            "c_lower > 0",
            "(18), after Assumption 4",
            float(spectrum[0]),
            0.0,
            bool(spectrum[0] > 0.0 and rank == m),
            f"λ_min, with λ_max = {spectrum[-1]:.3g}; it moves with the actors and is followed online",
        ),
        Condition(
            "|ω / p| <= 1",
            "before the theorem",
            float(normalized.max()),
            1.0,
            bool(normalized.max() <= 1.0),
            "largest over the samples; (ω/p) δ is not bounded by it",
        ),
    ]


def _gains(scenario: Scenario, station: StationKeeping, learner: Learner) -> list[Condition]:
    settings = scenario.learner
    lipschitz = drift_bound(station, max(scenario.samples.number, 500))
    gain = settings.gain_critic
    actors = settings.gain_actor_1 + settings.gain_actor_2
    known = actors / (2.0 * gain) if gain > 0.0 else np.inf
    margin = learner.rank_margin()
    q_lower = float(np.linalg.eigvalsh(station.game.Q).min())
    fails = margin <= known
    return [
        Condition(
            "q_lower > η_c L_f sup|ε'| ε / 2",
            "(24)",
            q_lower,
            None,
            None,
            f"λ_min(Q); η_c = {gain:g}, L_f = {lipschitz:.4g} = sup|f|/|ζ| over samples; {NO_EPSILON}",
        ),
        Condition(
            "c_lower > L_f sup|ε'| / (2 ε) + (η_a1 + η_a2) / (2 η_c)",
            "(25)",
            margin,
            known,
            False if fails else None,
            "the bound is its known part (η_a1 + η_a2) / (2 η_c)"
            + ("; it fails even with ε' = 0" if fails else f"; {NO_EPSILON}")
            + ("" if settings.rule == "gradient" else "; derived for the gradient law only"),
        ),
    ]


def drift_bound(station: StationKeeping, n_points: int, seed: int = 0) -> float:
    """Return L_f, the largest |f(ζ)| / |ζ| over seeded points of the envelope, trim taken out."""
    points = draw_samples(station.envelope, n_points, seed)
    f = station.functions.at(points).f
    return float((np.linalg.norm(f, axis=1) / np.linalg.norm(points, axis=1)).max())


def _attenuation(station: StationKeeping) -> list[Condition]:
    game = station.game
    least = float(np.linalg.eigvalsh(game.R).min())
    definite = float(np.linalg.eigvalsh(game.R_eff_inverse).min())
    star = station.problem.gamma_star
    return [
        Condition(
            "λ_min(R) >= γ^2",
            "(26) as printed",
            least,
            game.gamma**2,
            least >= game.gamma**2,
            "printed the wrong way round: it should fail",
        ),
        Condition(
            "R^-1 - γ^-2 W_d^-1 > 0",
            "(26) corrected",
            definite,
            0.0,
            definite > 0.0,
            "smallest eigenvalue; without it the HJI has no solution at a rest point",
        ),
        Condition(
            "γ > γ*",
            "after (5)",
            game.gamma,
            star,
            game.gamma > star,
            "γ* of the linearised game, by bisection",
        ),
    ]
