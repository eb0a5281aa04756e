"""What the numbers rest on that the paper, in continuous time, leaves out: steps, holds, periods."""

from __future__ import annotations

import numpy as np

from ...online import draw_samples
from ...online.learning import learning_period, paid_share
from ...online.rows import Predictor
from ...symbolic import RunError, Setup
from ...symbolic.arrays import Array
from ...symbolic.game import fastest_mode, held_loop, longest_period
from ...symbolic.integration import integrate
from ..scenario import Scenario
from .condition import Condition

PREDICTED = 1e-4  # relative error of a predicted cost
N_STATES = 3  # of the envelope, beside the scenario's own
LEFT = 0.1  # of the cost, after the horizon of a prediction
HALVED = 2.0  # of the gains, 6 dB
LATE = 0.16  # of the cost, within a learning period
MOST_CALLS = 50_000  # of the integration: three times what the fastest published vehicle needs
OWN = "not in the paper"


def numerical_conditions(scenario: Scenario) -> list[Condition]:
    """Return how good predictions are, whether the loop can be held, and if learning is in time."""
    setup = scenario.setup()
    if not setup.problem.same_inputs:
        return []
    return [
        _prediction(scenario, setup),
        _horizon(scenario, setup),
        *_held(scenario, setup),
        _pace(scenario, setup),
    ]


def _prediction(scenario: Scenario, setup: Setup) -> Condition:
    """Compare predicted costs with an integration with error control, of another code."""
    learner, seed = scenario.learner, scenario.simulation.seed
    predictor = Predictor(setup.functions, learner.horizon, learner.steps)
    states = [scenario.initial_state, *draw_samples(setup.envelope, N_STATES, seed)]
    errors = [_error(setup, predictor, state, learner.horizon) for state in states if state.any()]
    worst = max(errors, default=0.0)
    fastest, state = fastest_mode(setup.problem)
    return Condition(
        "predicted costs are accurate",
        OWN,
        worst,
        PREDICTED,
        worst <= PREDICTED,
        f"largest relative error from the scenario's state and {N_STATES} of the envelope, against an "
        f"integration with error control; {predictor.method}, fastest mode {fastest:.3g} 1/s in "
        f"{state}; raise learner.steps",
    )


def _error(setup: Setup, predictor: Predictor, zeta: Array, horizon: float) -> float:
    """Return the relative error of the Riccati weights' predicted cost from ζ, infinite if lost."""
    weights = setup.riccati_weights
    predicted = predictor.cost(zeta, weights, weights)
    if not np.isfinite(predicted):
        return np.inf
    try:
        known = integrated_cost(setup, zeta, weights, horizon)
    except RunError:
        return np.inf
    return abs(predicted / known - 1.0)


def integrated_cost(setup: Setup, zeta: Array, weights: Array, horizon: float) -> float:
    """Return J of the policies (14)(15) of some weights, by scipy's DOP853, with ζ'P ζ at the end.

    Raises
    ------
    RunError
        If the integration fails.
    """
    functions, game, P = setup.functions, setup.game, setup.problem.P

    def rates(_: float, y: Array) -> Array:
        here = functions.at(y[None, :-1])
        u_1, u_2 = functions.policies(y[:-1], weights, weights)
        zeta_dot = here.f[0] + here.g[0] @ (u_1 + u_2)
        return np.append(zeta_dot, game.local_cost(y[:-1], u_1, u_2))

    tolerance = np.append(1e-8 * setup.half_widths, 1e-8)
    start, span = np.append(zeta, 0.0), np.array([0.0, horizon])
    (end,) = integrate(rates, start, span, rtol=1e-9, atol=tolerance, max_calls=MOST_CALLS)
    return float(end[-1] + end[:-1] @ P @ end[:-1])


def _horizon(scenario: Scenario, setup: Setup) -> Condition:
    horizon, problem = scenario.learner.horizon, setup.problem
    left = 1.0 - paid_share(problem, horizon)
    return Condition(
        "the horizon covers the decay",
        OWN,
        left,
        LEFT,
        left <= LEFT,
        f"share of the cost that is left after learner.horizon = {horizon:g} s, where ζ'P ζ takes its "
        f"place; the slowest mode decays at {problem.decay_rate:.3g} 1/s",
    )


def _held(scenario: Scenario, setup: Setup) -> list[Condition]:
    period, problem = scenario.simulation.control_period, setup.problem
    loop = held_loop(problem, period)
    fastest, state = fastest_mode(problem)
    longest = longest_period(problem, max(period, 1.0))
    return [
        Condition(
            "the held loop is stable",
            OWN,
            loop.radius,
            loop.bound,
            loop.holds,
            f"spectral radius over a control period of {period:g} s; the bound is half the continuous "
            f"loop's decay; the longest period is {longest:g} s; fastest mode {fastest:.3g} 1/s in "
            f"{state}",
        ),
        Condition(
            "gain margin of the held loop",
            OWN,
            loop.gain_margin,
            HALVED,
            loop.gain_margin >= HALVED,
            "what the linear policy's gains may be multiplied with (8 at most shown); below 2 (6 dB) "
            "shorten simulation.control_period or raise R",
        ),
    ]


def _pace(scenario: Scenario, setup: Setup) -> Condition:
    period = learning_period(setup.problem, scenario.learner)
    share = paid_share(setup.problem, period)
    return Condition(
        "learning is in time",
        OWN,
        share,
        LATE,
        share <= LATE,
        f"share of the cost that is paid within one learning period of {period:g} s; shorten "
        "learner.period",
    )
