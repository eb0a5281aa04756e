"""The saddle from both sides, and worst cases, on games whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from casadi import DM
from stationkeep.offline import (
    BestResponse,
    ControlPolicy,
    DirectSolver,
    WorstCaseSolver,
    linear_policy,
)

from .games import FAR_STATE, linear_quadratic, two_state


def test_neither_player_gains_on_the_two_state_game() -> None:
    problem, zeta0 = two_state()[0], np.array([1.0, -0.7])
    direct = DirectSolver(problem, horizon=20.0, n_intervals=30, degree=6, grading=3.0)
    solution = direct.solve(zeta0, verify=False)
    found = BestResponse(problem).solve(zeta0, solution.value, solution.trajectory)
    exact = zeta0[0] ** 2 / 2.0 + zeta0[1] ** 2
    assert found.holds
    assert found.upper == pytest.approx(exact, rel=1e-7)
    assert found.lower == pytest.approx(exact, rel=1e-7)


def test_worst_case_of_the_optimal_linear_policy_is_the_value() -> None:
    """On the linear-quadratic game the linear policy is u_1*, so its worst case costs ζ'P ζ."""
    problem = linear_quadratic()[0]
    policy = ControlPolicy(problem, linear_policy(problem))
    found = WorstCaseSolver(policy).solve(FAR_STATE)
    assert found.unbounded is None
    assert found.cost == pytest.approx(float(FAR_STATE @ problem.P @ FAR_STATE), rel=1e-8)


def test_l2_gain_is_the_peak_of_the_frequency_response() -> None:
    problem = linear_quadratic()[0]
    policy = ControlPolicy(problem, linear_policy(problem))
    sweep = np.logspace(-3, 3, 4000)
    peak = max(np.linalg.norm(policy.frequency_response(omega), 2) for omega in sweep)
    assert policy.l2_gain <= problem.game.gamma
    assert policy.l2_gain == pytest.approx(peak, rel=1e-4)


def test_a_policy_that_does_not_attain_gamma_has_no_worst_case() -> None:
    problem = linear_quadratic()[0]
    weak = ControlPolicy(problem, DM(0.3) * linear_policy(problem))
    assert weak.l2_gain > problem.game.gamma
    found = WorstCaseSolver(weak).solve(FAR_STATE)
    assert found.unbounded is not None
    assert np.isinf(found.cost)
