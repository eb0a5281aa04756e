"""Predicted paths and costates: closed forms, finite differences, an independent integration."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are
from stationkeep.symbolic import Prediction, ValueFunctions, growing_steps

from .games import TWO_STATE_WEIGHTS, Array, linear_quadratic, two_state

Policies = Callable[[Array], Sequence[Array]]

START = np.array([1.0, -1.5])
STEPS = growing_steps(20.0, 400)


def prediction(functions: ValueFunctions) -> Prediction:
    return functions.prediction(20.0, len(STEPS))


def test_steps_add_up_and_grow() -> None:
    assert STEPS.sum() == pytest.approx(20.0, rel=1e-14)
    assert STEPS[-1] / STEPS[0] == pytest.approx(5.0)
    assert np.all(np.diff(STEPS) > 0.0)


def test_optimal_policies_cost_the_value_and_the_costate_is_its_gradient() -> None:
    """V* = ζ_1^2 / 2 + ζ_2^2, so J = 2.75 and λ = (ζ_1, 2 ζ_2) all along the path."""
    weights = TWO_STATE_WEIGHTS
    path = prediction(two_state()[2]).costates(START, weights, weights)
    assert path.cost == pytest.approx(2.75, rel=1e-6)
    V = path.states[:, 0] ** 2 / 2 + path.states[:, 1] ** 2
    np.testing.assert_allclose(path.cost_to_go, V, atol=1e-6)
    assert path.costates is not None
    np.testing.assert_allclose(path.costates, path.states * [1.0, 2.0], atol=1e-5)


@pytest.mark.parametrize(
    "actors", [((0.8, 0.2, 1.4), (0.8, 0.2, 1.4)), ((0.8, 0.2, 1.4), (0.3, 0, 0.7))]
)
def test_path_agrees_with_another_integration(actors: tuple[tuple[float, ...], ...]) -> None:
    problem, _, functions = two_state()
    actor_1, actor_2 = (np.array(actor) for actor in actors)
    assert functions.at(START[None, :]).f.shape == (1, 2)
    path = prediction(functions).path(START, actor_1, actor_2)
    states, cost = integrated(lambda zeta: functions.policies(zeta, actor_1, actor_2), path.times)
    np.testing.assert_allclose(path.states, states, atol=1e-5)
    rest = states[-1] @ problem.P @ states[-1]
    assert path.cost == pytest.approx(cost + rest, rel=1e-6)


def integrated(policies: Policies, times: Array) -> tuple[Array, Array]:
    """Return scipy's states at the times and the cost at the last, under policies from START."""
    problem, _, functions = two_state()

    def rates(t: float, y: Array) -> Array:
        here = functions.at(y[None, :2])
        u_1, u_2 = policies(y[:2])
        cost = problem.game.local_cost(y[:2], u_1, u_2)
        return np.append(here.f[0] + here.g[0] @ (u_1 + u_2), cost)

    start = np.append(START, 0.0)
    known = solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-10, atol=1e-12)
    return known.y[:2].T, known.y[2, -1]


def test_linear_path_agrees_with_another_integration() -> None:
    """With gains from scipy's Riccati solution; R = 1, γ = 2, W_d = 1."""
    problem, _, functions = two_state()
    A, B = problem.linearization
    P = solve_continuous_are(A, B, problem.game.Q, problem.game.R_eff)
    push = B.T @ P
    path = prediction(functions).linear_path(START)
    states, cost = integrated(lambda zeta: (-push @ zeta, push @ zeta / 4.0), path.times)
    np.testing.assert_allclose(path.states, states, atol=1e-5)
    assert path.cost == pytest.approx(cost + states[-1] @ P @ states[-1], rel=1e-6)


def test_linear_path_of_a_linear_quadratic_game_costs_its_value() -> None:
    problem, _, functions = linear_quadratic()
    zeta = 0.3 * problem.scale
    path = functions.prediction(30.0, 300).linear_path(zeta)
    assert path.cost == pytest.approx(zeta @ problem.P @ zeta, rel=1e-6)


def test_costate_is_the_gradient_of_the_predicted_cost() -> None:
    """By central differences, for unequal actors far from the optimum."""
    functions = two_state()[2]
    actor_1, actor_2 = np.array([0.8, 0.2, 1.4]), np.array([0.3, 0.0, 0.7])
    predict = prediction(functions)
    path = predict.costates(START, actor_1, actor_2)
    assert path.costates is not None
    for i, step in enumerate(1e-5 * np.eye(2)):
        higher, lower = (predict.path(START + side * step, actor_1, actor_2).cost for side in (1, -1))
        assert path.costates[0, i] == pytest.approx((higher - lower) / 2e-5, rel=1e-7)


def test_linear_quadratic_costate_is_twice_P_zeta() -> None:
    problem, basis, functions = linear_quadratic()
    exact = basis.quadratic_weights(problem.P)
    start = 0.3 * problem.scale
    path = prediction(functions).costates(start, exact, exact)
    assert path.cost == pytest.approx(start @ problem.P @ start, rel=1e-5)
    assert path.costates is not None
    expected = 2.0 * path.states @ problem.P
    np.testing.assert_allclose(path.costates, expected, atol=1e-4 * np.abs(expected).max())


def test_a_path_that_leaves_costs_infinitely_much() -> None:
    functions = two_state()[2]
    path = prediction(functions).costates(START, *2 * [-3.0 * TWO_STATE_WEIGHTS])
    assert path.cost == np.inf
    assert np.all(np.isfinite(path.states))
    assert np.abs(path.states).max() <= 4.0 * 2.0  # half-widths of 2


def test_rows_are_the_excess_of_the_hamiltonian() -> None:
    """|L g'(σ'^T W - λ)|^2 = H at the policies of W, with the gradient λ, less H at those of λ."""
    problem, _, functions = two_state()
    game, rng = problem.game, np.random.default_rng(0)
    points, costates = rng.uniform(-1.0, 1.0, (2, 7, 2))
    weights = rng.standard_normal(3)
    regressors, targets, sigma = prediction(functions).rows(points, costates)
    assert regressors.shape == (7, 1, 3)
    found = np.sum((regressors @ weights - targets) ** 2, axis=1)
    np.testing.assert_allclose(sigma, [functions.sigma(point)[0] for point in points])
    terms = functions.at(points)
    for j, point in enumerate(points):
        f, g = terms.f[j], terms.g[j]
        u_1, u_2 = functions.policies(point, weights, weights)
        excess = game.hamiltonian(point, f, g, costates[j], u_1, u_2)
        excess -= game.stationary_hamiltonian(point, f, g, costates[j])
        assert found[j] == pytest.approx(excess, rel=1e-9, abs=1e-12)
