"""The neighbouring-optimal feedback: closed forms, and optima solved again from nearby states."""

from __future__ import annotations

import numpy as np
from casadi import DM, SX, Function
from stationkeep.offline import DirectSolver
from stationkeep.offline.responses.neighbour import Feedback, NeighbouringOptimum, feedback_law
from stationkeep.symbolic import Problem

from .games import FAST_STATE, HALF_WIDTHS, linear_quadratic, two_state


def test_two_state_game_has_its_closed_form() -> None:
    """v* = -R_eff^-1 c ζ_2 with c = cos(2 ζ_1) + 2, so K = R_eff^-1 (-2 sin(2 ζ_1) ζ_2, c)."""
    problem, _, _ = two_state()
    direct = DirectSolver(problem, horizon=15.0, n_intervals=60)
    path = direct.solve(np.array([1.2, -1.5])).trajectory
    times = path.times[1:151]
    feedback = NeighbouringOptimum(problem).along(path, times)
    states, v = path.sample(times)
    inverse = problem.game.R_eff_inverse[0, 0]
    c = np.cos(2.0 * states[:, 0]) + 2.0
    expected = inverse * np.stack([-2.0 * np.sin(2.0 * states[:, 0]) * states[:, 1], c], axis=1)
    np.testing.assert_allclose(feedback.gain[:, 0], expected, atol=1e-7)
    np.testing.assert_allclose([feedback.v(t, z) for t, z in zip(times, states, strict=True)], v)


def test_linear_quadratic_game_has_its_constant_gain() -> None:
    problem, _, _ = linear_quadratic()
    path = DirectSolver(problem, horizon=60.0, n_intervals=20).solve(FAST_STATE).trajectory
    feedback = NeighbouringOptimum(problem).along(path, path.times[1::7])
    _, B = problem.linearization
    expected = problem.game.R_eff_inverse @ B.T @ problem.P
    assert np.abs(feedback.gain - expected).max() < 1e-6 * np.abs(expected).max()


def test_gain_is_the_derivative_of_the_optimal_input(reference_problem: Problem) -> None:
    """Optima solved again from both sides of a state on the way: drag, attitude and their curvature."""
    direct = DirectSolver(reference_problem, horizon=80.0, n_intervals=24)
    path = direct.solve_aligned(FAST_STATE)[0].trajectory
    time = path.mesh[6]
    zeta = path.sample(np.array([time]))[0][0]
    K = NeighbouringOptimum(reference_problem).along(path, np.array([time])).gain[0]
    direction = HALF_WIDTHS * np.random.default_rng(2).standard_normal(12)
    h, game = 1e-3, reference_problem.game
    inputs = []
    for sign in (1.0, -1.0):
        state = zeta + sign * h * direction
        costate = direct.solve_aligned(state)[0].costate
        inputs.append(-0.5 * game.R_eff_inverse @ direct.plant.terms(state)[1].T @ costate)
    slope = (inputs[0] - inputs[1]) / (2.0 * h)
    np.testing.assert_allclose(-K @ direction, slope, atol=2e-3 * np.abs(slope).max())
    linear = game.R_eff_inverse @ reference_problem.linearization[1].T @ reference_problem.P
    assert np.abs((K - linear) @ direction).max() > 0.1 * np.abs(slope).max()


def test_law_and_parameters_agree() -> None:
    """The expression, given the parameters as `Feedback` orders them, is offset - gain ζ."""
    rng = np.random.default_rng(5)
    feedback = Feedback(np.arange(3.0), rng.standard_normal((3, 2)), rng.standard_normal((3, 2, 4)))
    zeta = SX.sym("zeta", 4)
    law, parameters = feedback_law(zeta, 2)
    evaluate = Function("law", [zeta, parameters], [law])
    point = rng.standard_normal(4)
    for j in range(3):
        expected = feedback.offset[j] - feedback.gain[j] @ point
        found = DM(evaluate(point, feedback.parameters[j])).full().ravel()
        np.testing.assert_allclose(found, expected, atol=1e-14)
        np.testing.assert_allclose(feedback.v(float(j), point), expected, atol=1e-14)
    between = feedback.v(0.25, point)
    np.testing.assert_allclose(between, 0.75 * feedback.v(0.0, point) + 0.25 * feedback.v(1.0, point))
    np.testing.assert_allclose(feedback.v(9.0, point), feedback.v(2.0, point))
