"""The paper's assumptions and conditions, each with its number for a scenario.

Conditions that need sup|ε'| of Assumption 3 take it from ideal weights. Without them such a condition
has the value None and says so; where a part of its bound is known, the bound is that part.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from ...offline import Plant
from ...online import AS_PRINTED, Learner, draw_samples, rank_margin
from ...online.loop import fixed_points
from ...online.paper import regressor_spectrum
from ...symbolic import Setup, StationKeeping
from ...symbolic.arrays import Array
from ..optima import Bounds
from ..scenario import Scenario
from .condition import Condition
from .numerical_conditions import numerical_conditions
from .problem_conditions import domain_conditions, equilibrium
from .vehicle_conditions import vehicle_conditions, vehicle_equilibrium

NO_EPSILON = "needs sup|ε'| of Assumption 3: give --ideal-weights"


def scenario_conditions(
    scenario: Scenario, bounds: Bounds | None = None, c_lower: float | None = None
) -> list[Condition]:
    """Return every assumption and condition of the paper with its value for the scenario.

    Parameters
    ----------
    bounds : on ε and ε', from ideal weights, see `optima.load_ideal`
    c_lower : infimum over a run of (18)'s λ_min; that at the initial weights if None
    """
    setup = scenario.setup()
    learner = Learner(
        setup.problem,
        setup.basis,
        scenario.learner.model_copy(update=AS_PRINTED),
        fixed_points(scenario.samples, setup),
        setup.riccati_weights,
        scenario.initial_weights(),
        setup.functions,
    )
    residual = learner.sample_residual()
    margin = rank_margin(residual.omega)
    margin = margin if c_lower is None else min(margin, c_lower)
    return [
        *_own(scenario, setup),
        _representation(bounds, setup.problem.n_states),
        *_samples(scenario, learner),
        *_gains(scenario, setup, margin, bounds),
        *_attenuation(setup),
        *numerical_conditions(scenario),
    ]


def _own(scenario: Scenario, setup: Setup) -> list[Condition]:
    """Return what is asked of the problem itself: a vehicle's attitude and inertia, or the domain."""
    if isinstance(setup, StationKeeping):
        limit = scenario.simulation.pitch_limit
        return [*vehicle_conditions(setup, limit), vehicle_equilibrium(setup)]
    return [*domain_conditions(setup), equilibrium(setup)]


def _representation(bounds: Bounds | None, n: int) -> Condition:
    smooth = f"σ is smooth, so bounded on χ, though not on R^{n} as printed; "
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


def _gains(scenario: Scenario, setup: Setup, margin: float, bounds: Bounds | None) -> list[Condition]:
    """(24) and (25) share a free ε > 0: (24) is looked at with the least that (25) admits, and back."""
    settings = scenario.learner
    lipschitz = drift_bound(setup, max(scenario.samples.number, 500))
    gain = settings.gain_critic
    actors = settings.gain_actor_1 + settings.gain_actor_2
    known = actors / (2.0 * gain) if gain > 0.0 else np.inf
    q_lower = float(np.linalg.eigvalsh(setup.game.Q).min())
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


def drift_bound(setup: Setup, n_points: int, seed: int = 0) -> float:
    """Return L_f = sup |f(ζ)| / |ζ| over the envelope, trim taken out.

    The largest of seeded points, and of local maxima that are climbed to from the best five of them.
    """
    points, plant = draw_samples(setup.envelope, n_points, seed), Plant(setup.problem)
    f = setup.functions.at(points).f
    ratios = np.linalg.norm(f, axis=1) / np.linalg.norm(points, axis=1)

    def steepness(x: Array) -> float:
        zeta = setup.envelope * x
        return -float(np.linalg.norm(plant.terms(zeta)[0]) / np.linalg.norm(zeta))

    tops = [
        minimize(
            steepness,
            points[i] / setup.envelope,
            method="L-BFGS-B",
            bounds=[(-1.0, 1.0)] * setup.problem.n_states,
        )
        for i in np.argsort(-ratios)[:5]
    ]
    return float(max(ratios.max(), *(-top.fun for top in tops)))


def _attenuation(setup: Setup) -> list[Condition]:
    game = setup.game
    least = float(np.linalg.eigvalsh(game.R).min())
    definite = float(np.linalg.eigvalsh(game.R_eff_inverse).min())
    star = setup.problem.gamma_star
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
