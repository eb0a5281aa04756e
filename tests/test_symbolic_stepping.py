"""Steps of predictions: exact where the loop is linear, of order four, right where modes are fast."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from stationkeep.symbolic.integration import doubled_phi, phi_functions
from stationkeep.symbolic.value.stepping import Exponential, RungeKutta, graded_steps, stepping_of

from .games import linear_quadratic, two_state


def test_phi_functions_are_their_integrals_and_double() -> None:
    """φ_1(A) = A^-1 (e^A - 1) and φ_{k+1}(A) = A^-1 (φ_k(A) - 1/k!), for an invertible A."""
    A = np.random.default_rng(0).standard_normal((4, 4)) - 2.0 * np.eye(4)
    phi = phi_functions(A)
    np.testing.assert_allclose(phi[0], scipy.linalg.expm(A), atol=1e-14)
    for k, factorial in enumerate((1.0, 1.0, 2.0)):
        expected = np.linalg.solve(A, phi[k] - np.eye(4) / factorial)
        np.testing.assert_allclose(phi[k + 1], expected, atol=1e-13)
    for found, expected in zip(doubled_phi(phi), phi_functions(2.0 * A), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-13)


def test_graded_steps_add_up_and_begin_within_the_fastest_mode() -> None:
    steps = graded_steps(30.0, 150, 90.0)
    assert steps.sum() == pytest.approx(30.0, rel=1e-14)
    assert steps[0] * 90.0 <= 0.5
    assert np.all(np.diff(steps) > 0.0)


def test_the_method_follows_the_fastest_mode() -> None:
    problem = two_state()[0]
    assert isinstance(stepping_of(problem, 20.0, 400), RungeKutta)
    assert isinstance(stepping_of(problem, 2000.0, 20), Exponential)


def test_a_linear_loop_is_exact_at_any_step() -> None:
    """Ten steps of a second and more: the cost is ζ'P ζ and the states are those of the exponential."""
    problem, basis, functions = linear_quadratic()
    functions = type(functions)(problem, basis, compiled=False)
    from stationkeep.symbolic import Prediction

    prediction = Prediction(
        problem, basis, Exponential(problem, np.full(10, 3.0)), functions._export_mapped
    )
    weights = basis.quadratic_weights(problem.P)
    start = 0.3 * problem.scale
    path = prediction.costates(start, weights, weights)
    assert path.cost == pytest.approx(start @ problem.P @ start, rel=1e-9)
    A, B = problem.linearization
    closed = A + B @ problem.linear_gain
    for time, state in zip(path.times, path.states, strict=True):
        np.testing.assert_allclose(state, scipy.linalg.expm(closed * time) @ start, atol=1e-9)
    assert path.costates is not None
    np.testing.assert_allclose(path.costates, 2.0 * path.states @ problem.P, atol=1e-7)


def test_order_four_and_the_costate_is_the_gradient() -> None:
    """Of the two-state game, whose optimal cost from (1, -1.5) is 2.75, by halving the steps."""
    from stationkeep.symbolic import Prediction

    problem, basis, functions = two_state()
    weights, start = np.array([0.8, 0.2, 1.4]), np.array([1.0, -1.5])

    def predict(n: int) -> Prediction:
        stepping = Exponential(problem, np.full(n, 20.0 / n))
        return Prediction(problem, basis, stepping, functions._export_mapped)

    known = predict(1600).path(start, weights, weights).cost
    errors = [abs(predict(n).path(start, weights, weights).cost - known) for n in (50, 100, 200)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.4)
    path = predict(100).costates(start, weights, weights)
    assert path.costates is not None
    for i, step in enumerate(1e-5 * np.eye(2)):
        higher, lower = (
            predict(100).path(start + side * step, weights, weights).cost for side in (1, -1)
        )
        assert path.costates[0, i] == pytest.approx((higher - lower) / 2e-5, rel=1e-6)
