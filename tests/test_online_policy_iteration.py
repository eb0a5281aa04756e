"""Batch policy iteration: Kleinman's on the linear-quadratic game, and what the online law tends to."""

from __future__ import annotations

from functools import cache

import casadi
import numpy as np
import pytest
import scipy.linalg
from stationkeep.online import Learner, draw_samples
from stationkeep.online.laws import row_weights
from stationkeep.online.learning.policy_iteration import (
    RowsUnder,
    bellman_rows,
    costate_rows,
    fitted,
    policy_iteration,
)
from stationkeep.online.paper import BellmanTerms
from stationkeep.online.rows import PathRows
from stationkeep.symbolic import Basis, Problem, RunError, ValueFunctions, quadratic

from .games import HALF_WIDTHS, Array, linear_quadratic, plain, two_state


def kleinman(problem: Problem, P: Array, n_steps: int) -> list[Array]:
    """Return P_0 ... P_n by scipy's Lyapunov solver."""
    A, B = problem.linearization
    iterates = [P]
    for _ in range(n_steps):
        K = problem.game.R_eff_inverse @ B.T @ iterates[-1]
        closed = A - B @ K
        Q = problem.game.Q + K.T @ np.linalg.inv(problem.game.R_eff_inverse) @ K
        iterates.append(scipy.linalg.solve_continuous_lyapunov(closed.T, -Q))
    return iterates


def state_cost_rows(functions: ValueFunctions, points: Array) -> RowsUnder:
    game = functions.problem.game
    terms = BellmanTerms.at(points, functions.at(points), game)
    return bellman_rows(terms, game, lambda omega, cost: row_weights("state_cost", omega, cost, 1e-3))


def test_bellman_rows_are_kleinmans_iteration() -> None:
    problem, basis, functions = linear_quadratic()
    expected = kleinman(problem, 0.6 * problem.P, 4)
    rows = state_cost_rows(functions, draw_samples(HALF_WIDTHS, 200, seed=3))
    found = policy_iteration(rows, basis.quadratic_weights(expected[0]), most=4)
    assert not found.converged
    for weights, P in zip(found.weights, expected, strict=True):
        exact = basis.quadratic_weights(P)
        np.testing.assert_allclose(weights, exact, atol=1e-8 * np.abs(exact).max())
    # the second step is far from the first, and quadratic convergence leaves little to the fourth
    gaps = [np.linalg.norm(P - problem.P) / np.linalg.norm(problem.P) for P in expected]
    assert gaps[1] > 0.02
    assert gaps[4] < 1e-3


@cache
def linear_two_state() -> tuple[Problem, Basis, ValueFunctions]:
    problem = two_state()[0].linearized()
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.ones(2))
    return problem, basis, ValueFunctions(problem, basis, compiled=False)


def two_state_paths(functions: ValueFunctions, n_steps: int = 800, points: int = 40) -> PathRows:
    return PathRows(functions.prediction(20.0, n_steps), points)


def test_costate_rows_are_kleinmans_iteration() -> None:
    problem, basis, functions = linear_two_state()
    expected = kleinman(problem, np.array([[0.9, 0.15], [0.15, 1.5]]), 3)
    rows = costate_rows(two_state_paths(functions), draw_samples(np.ones(2), 6, seed=0))
    found = policy_iteration(rows, basis.quadratic_weights(expected[0]), most=3)
    for weights, P in zip(found.weights, expected, strict=True):
        # an error of fourth order in the steps, of 0.01 to 0.04 s
        np.testing.assert_allclose(weights, basis.quadratic_weights(P), atol=2e-6)
    assert np.abs(expected[1] - expected[0]).max() > 0.1


@cache
def deficient() -> tuple[Problem, Basis, ValueFunctions]:
    """The nonlinear game with three functions that can't represent V* = ζ_1^2 / 2 + ζ_2^2."""
    problem = two_state()[0]
    basis = Basis.build(
        "deficient",
        lambda x: casadi.vertcat(x[0] ** 2, x[0] * x[1], x[1] ** 2 + x[1] ** 4 / 4),
        problem.zeta,
        np.ones(2),
    )
    return problem, basis, ValueFunctions(problem, basis, compiled=False)


START = np.array([0.8, 0.2, 1.4])


@pytest.mark.parametrize("leash", [0.0, 0.05])
def test_online_least_squares_tends_to_its_fixed_point(leash: float) -> None:
    """Where V* is not in the basis, so that the fixed point is the method's own."""
    problem, basis, functions = deficient()
    points = draw_samples(np.ones(2), 60, seed=2)
    learner = Learner(
        problem,
        basis,
        plain(leash=leash, gain_critic=50.0),
        points,
        START,
        functions=functions,
    )
    for _ in range(150):
        learner.step(np.zeros(2), 0.25)
    terms = BellmanTerms.at(points, functions.at(points), problem.game)
    rows = bellman_rows(terms, problem.game, lambda omega, _: row_weights("paper", omega, _, 0.0))
    if leash:
        # online the leash is measured once, at the reference, and stays as it is
        omega, _, weights = rows(START)
        fixed = leash * (weights @ omega**2)

        def leashed(W: Array) -> tuple[Array, Array, Array]:
            omega, cost, weights = rows(W)
            return (
                np.vstack([omega, np.eye(3)]),
                np.append(cost, -START),
                np.append(weights, fixed),
            )

        found = policy_iteration(leashed, START)
    else:
        found = policy_iteration(rows, START)
    assert found.converged
    np.testing.assert_allclose(learner.critic, found.weights[-1], rtol=1e-6)
    assert np.linalg.norm(found.weights[-1] - START) > 0.1


def test_fit_with_a_leash_solves_its_normal_equations() -> None:
    rng = np.random.default_rng(5)
    omega, cost, weights = rng.normal(size=(40, 6)), rng.normal(size=40), rng.uniform(0.1, 2.0, 40)
    reference, leash = rng.normal(size=6), 0.3
    matrix = (omega.T * weights) @ omega
    pull = leash * np.diag(matrix)
    expected = np.linalg.solve(matrix + np.diag(pull), pull * reference - (omega.T * weights) @ cost)
    found = fitted((omega, cost, weights), leash, reference)
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_a_policy_that_loses_the_vehicle_has_no_rows() -> None:
    _, _, functions = two_state()
    rows = costate_rows(two_state_paths(functions), draw_samples(np.ones(2), 2, seed=0))
    with pytest.raises(RunError, match="start from weights"):
        policy_iteration(rows, -START)


@pytest.mark.parametrize("zeta", [(0.7, -0.9), (-1.0, 0.4)])
def test_rows_relative_to_the_whole_are_the_gradient_of_the_cost(zeta: tuple[float, float]) -> None:
    """2 Σ w ω (ω'W - r) = ∂ln J/∂W by central differences, to the second order of the trapezoids."""
    _, _, functions = deficient()
    start = np.array(zeta)
    errors = []
    for n_steps in (200, 400):
        prediction = functions.prediction(20.0, n_steps)

        def log_cost(W: Array) -> float:
            return float(np.log(prediction.path(start, W, W).cost))  # noqa: B023

        expected = np.array(
            [(log_cost(START + d) - log_cost(START - d)) / 2e-5 for d in 1e-5 * np.eye(3)]
        )
        paths = PathRows(prediction, n_steps, "whole")
        omega, target, weights = paths.at(start[None, :], START, START)
        # one row a point for the single input; those of the value follow
        omega, target, weights = omega[:n_steps], target[:n_steps], weights[:n_steps]
        found = 2.0 * (weights * (omega @ START - target)) @ omega
        errors.append(np.abs(found - expected).max() / np.abs(expected).max())
    assert errors[0] < 0.02
    assert errors[1] < 0.3 * errors[0]
