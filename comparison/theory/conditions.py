"""The paper's assumptions and conditions, each with its number for a scenario.

Conditions that need sup|ε'| of Assumption 3 take it from ideal weights. Without them such a condition
has the value None and says so; where a part of its bound is known, the bound is that part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from ...online import AS_PRINTED, Learner, draw_samples, rank_margin
from ...online.paper import regressor_spectrum
from ...online.vehicle import fixed_points
from ...symbolic import StationKeeping
from ...symbolic.arrays import Array
from ..optima import Bounds
from ..scenario import Scenario

NO_EPSILON = "needs sup|ε'| of Assumption 3: give --ideal-weights"


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


def check(
    scenario: Scenario, bounds: Bounds | None = None, c_lower: float | None = None
) -> list[Condition]:
    """Return every assumption and condition of the paper with its value for the scenario.

    Parameters
    ----------
    bounds : on ε and ε', from ideal weights, see `comparison.ideal.load_ideal`
    c_lower : infimum over a run of (18)'s λ_min; that at the initial weights if None
    """
    station = scenario.station_keeping()
    learner = Learner(
        station.problem,
        station.basis,
        scenario.learner.model_copy(update=AS_PRINTED),
        fixed_points(scenario.samples, station),
        station.riccati_weights,
        scenario.initial_weights(),
        station.functions,
    )
    residual = learner.sample_residual()
    margin = rank_margin(residual.omega)
    margin = margin if c_lower is None else min(margin, c_lower)
    return [
        _pitch(scenario),
        *_inertia(scenario, station),
        _equilibrium(station),
        _representation(bounds),
        *_samples(scenario, learner),
        *_gains(scenario, station, margin, bounds),
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


def _representation(bounds: Bounds | None) -> Condition:
    smooth = "σ is smooth, so bounded on χ, though not on R^12 as printed; "
    value, holds, numbers = None, None, "sup|ε| and sup|ε'|: give --ideal-weights"
    if bounds is not None:
        value, holds = bounds.epsilon, True
        numbers = (
            f"sup|ε| with sup|ε'| = {bounds.epsilon_prime:.4g}, as {bounds.n_states} states of the "
            "envelope show them"
        )
    return Condition(
        "V = W'σ + ε with bounded ε, ε'", "Assumption 3", value, None, holds, smooth + numbers
    )


def _samples(scenario: Scenario, learner: Learner) -> list[Condition]:
    residual = learner.sample_residual()
    m = learner.basis.n_basis
    if not len(residual):
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


def _gains(
    scenario: Scenario, station: StationKeeping, margin: float, bounds: Bounds | None
) -> list[Condition]:
    """(24) and (25) share a free ε > 0: (24) is looked at with the least that (25) admits, and back."""
    settings = scenario.learner
    lipschitz = drift_bound(station, max(scenario.samples.number, 500))
    gain = settings.gain_critic
    actors = settings.gain_actor_1 + settings.gain_actor_2
    known = actors / (2.0 * gain) if gain > 0.0 else np.inf
    q_lower = float(np.linalg.eigvalsh(station.game.Q).min())
    fails = margin <= known
    first, second, holds = None, known, False if fails else None
    first_note = NO_EPSILON
    if bounds is not None:
        largest = 2.0 * q_lower / (gain * lipschitz * bounds.epsilon_prime) if gain > 0.0 else np.inf
        first_note = f"it holds for ε < {largest:.3g}, but no ε satisfies (25)"
    second_note = "the bound is its known part (η_a1 + η_a2) / (2 η_c)"
    second_note += "; it fails even with ε' = 0" if fails else f"; {NO_EPSILON}"
    if bounds is not None and not fails:
        # ε = L_f sup|ε'| / (2 (c - known)) from (25) in (24), and ε = 2 q / (η_c L_f sup|ε'|) back
        product = gain * (lipschitz * bounds.epsilon_prime) ** 2 / 4.0
        first, second = product / (margin - known), known + product / q_lower
        holds = margin > second
        first_note, second_note = "with the least ε of (25)", "with the largest ε of (24)"
    gradient_only = "" if settings.rule == "gradient" else "; derived for the gradient law only"
    return [
        Condition(
            "q_lower > η_c L_f sup|ε'| ε / 2",
            "(24)",
            q_lower,
            first,
            None if first is None else q_lower > first,
            f"λ_min(Q); η_c = {gain:g}, L_f = {lipschitz:.4g} = sup|f|/|ζ| over the envelope; "
            + first_note,
        ),
        Condition(
            "c_lower > L_f sup|ε'| / (2 ε) + (η_a1 + η_a2) / (2 η_c)",
            "(25)",
            margin,
            second,
            holds,
            second_note + gradient_only,
        ),
    ]


def drift_bound(station: StationKeeping, n_points: int, seed: int = 0) -> float:
    """Return L_f = sup |f(ζ)| / |ζ| over the envelope, trim taken out.

    The largest of seeded points, and of local maxima that are climbed to from the best five of them.
    """
    points = draw_samples(station.envelope, n_points, seed)
    f = station.functions.at(points).f
    ratios = np.linalg.norm(f, axis=1) / np.linalg.norm(points, axis=1)

    def steepness(x: Array) -> float:
        zeta = station.envelope * x
        return -float(np.linalg.norm(station.model.drift(zeta)) / np.linalg.norm(zeta))

    tops = [
        minimize(steepness, points[i] / station.envelope, method="L-BFGS-B", bounds=[(-1.0, 1.0)] * 12)
        for i in np.argsort(-ratios)[:5]
    ]
    return float(max(ratios.max(), *(-top.fun for top in tops)))


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
