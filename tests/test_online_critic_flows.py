"""The critic laws beside their differential equations, integrated by scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from stationkeep.online.laws import Gradient, LeastSquares, NormalEquations, row_weights

from .games import Array

M = 5
BETA, BOUND, START = 1.5, 4.0, np.linspace(-1.0, 1.0, M)


def rows(seed: int, n_rows: int, size: float) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    return size * rng.standard_normal((n_rows, M)), rng.standard_normal(n_rows)


def equations(omega: Array, cost: Array, weights: Array, critic: Array) -> NormalEquations:
    delta = cost + omega @ critic
    return NormalEquations.of(omega, delta, weights, np.zeros(M), np.zeros(M))


@pytest.mark.parametrize("size", [0.1, 1.0, 30.0])
def test_normalised_gradient_is_the_flow_of_its_law(size: float) -> None:
    """Ŵ_c_dot = -η_c Σ ω δ / p, η_c = 3, one row after another, for small and large ω."""
    omega, cost = rows(1, 8, size)

    def law(t: float, W: Array) -> Array:
        rate = np.zeros(M)
        for regressor, local in zip(omega, cost, strict=True):
            p = np.sqrt(1.0 + regressor @ regressor)
            rate -= 3.0 * regressor * (local + regressor @ W) / p
        return rate

    answer = solve_ivp(law, (0.0, 0.4), START, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    weights = 3.0 * row_weights("paper", omega, np.ones(8), 0.0)
    found = Gradient().step(START, equations(omega, cost, weights, START), 0.4)
    np.testing.assert_allclose(found, answer, rtol=1e-9, atol=1e-10)
    assert np.abs(answer - START).max() > 0.01


def test_least_squares_with_a_bounded_covariance_tends_to_its_law() -> None:
    """Γ_dot = β (1 - λ_max(Γ) / Γ_max) Γ - Γ A Γ, to first order: λ_max is held over a step."""
    omega, cost = rows(2, 3, 0.5)
    A, b = omega.T @ omega, omega.T @ cost

    def law(t: float, y: Array) -> Array:
        W, covariance = y[:M], y[M:].reshape(M, M)
        beta = BETA * (1.0 - np.linalg.eigvalsh(covariance)[-1] / BOUND)
        grown = beta * covariance - covariance @ A @ covariance
        return np.append(-covariance @ (A @ W + b), grown.ravel())

    y0 = np.append(START, np.eye(M).ravel())
    answer = solve_ivp(law, (0.0, 2.0), y0, "DOP853", rtol=1e-10, atol=1e-11).y[:, -1]
    errors = []
    for n_steps in (50, 100, 200):
        squares, critic = LeastSquares(M, BETA, 1.0, BOUND), START
        for _ in range(n_steps):
            critic = squares.step(critic, equations(omega, cost, np.ones(3), critic), 2.0 / n_steps)
        covariance = np.linalg.inv(squares.information)
        found = np.append(critic, covariance.ravel())
        errors.append(np.abs(found - answer).max())
    assert errors[0] < 0.1
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 2.0, rtol=0.05)
    # the bound is at work: without it the covariance would be e^{2 β}, unheld by three rows of five
    assert 2.0 < np.linalg.eigvalsh(covariance)[-1] < BOUND
