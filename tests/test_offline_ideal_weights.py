"""The fit of ideal weights: games whose weights are known, and what the norm says."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import casadi
import numpy as np
import pytest
from casadi import SX
from stationkeep.offline import (
    ErrorSize,
    OfflineSettings,
    OfflineSolver,
    Pairs,
    error_sizes,
    fit_weights,
)
from stationkeep.offline.ideal_weights import basis_at, least_states, representation_errors
from stationkeep.symbolic import Basis, InputError, drag, drag_cubic, quadratic

from .games import HALF_WIDTHS, TWO_STATE_WEIGHTS, Array, linear_quadratic, two_state

Check = Callable[[BaseException], str]


def states(n: int, scale: Array, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    shape = (n, len(scale))
    return np.asarray(scale * rng.uniform(-1.0, 1.0, shape) * rng.uniform(0.1, 1.0, (n, 1)))


@cache
def bent(seed: int = 0, n: int = 60) -> Pairs:
    """V = Σ x_i^2 (1 + |x_i|) + x_0 x_7: what no shipped basis holds."""
    x = states(n, np.ones(12), seed)
    values = np.sum(x**2 * (1.0 + np.abs(x)), axis=1) + x[:, 0] * x[:, 7]
    gradients = 2.0 * x + 3.0 * x * np.abs(x)
    gradients[:, 0] += x[:, 7]
    gradients[:, 7] += x[:, 0]
    return Pairs(x * HALF_WIDTHS, values, gradients / HALF_WIDTHS)


@cache
def basis(name: str) -> Basis:
    functions = {"quadratic": quadratic, "drag": drag, "drag-cubic": drag_cubic}
    return Basis.build(name, functions[name], SX.sym("zeta", 12), HALF_WIDTHS)


def norm_by_hand(basis: Basis, weights: Array, pairs: Pairs) -> float:
    """Return sqrt(J) without the ridge, state by state."""
    function = casadi.Function("f", [basis.zeta], [basis.sigma, basis.jacobian])
    total = 0.0
    for zeta, value, gradient in zip(pairs.states, pairs.values, pairs.gradients, strict=True):
        sigma, sigma_prime = (np.array(part) for part in function(zeta))
        total += ((value - sigma.ravel() @ weights) / value) ** 2
        error = (gradient - sigma_prime.T @ weights) * basis.scale
        total += error @ error / ((gradient * basis.scale) @ (gradient * basis.scale))
    return float(np.sqrt(total / len(pairs.values)))


def test_two_state_game_has_its_weights() -> None:
    """W* = (1/2, 0, 1) from solved pairs, and nothing is left over on others."""
    problem, monomials, _ = two_state()
    solver = OfflineSolver(problem, OfflineSettings(horizon=30.0, intervals=40))
    solved = [solver.solve(zeta) for zeta in states(9, problem.scale, 4)]
    assert not [fault for solution in solved for fault in solution.faults]
    pairs = Pairs(
        np.array([solution.direct.zeta for solution in solved]),
        np.array([solution.value for solution in solved]),
        np.array([solution.costate for solution in solved]),
    )
    training, others = (
        Pairs(pairs.states[part], pairs.values[part], pairs.gradients[part])
        for part in (slice(5), slice(5, None))
    )
    found = fit_weights(monomials, training)
    np.testing.assert_allclose(found.weights, TWO_STATE_WEIGHTS, atol=1e-8)
    assert found.norm < 1e-8
    epsilon, epsilon_prime = error_sizes(monomials, found.weights, others)
    assert epsilon.sup < 1e-7
    assert epsilon_prime.sup < 1e-7
    assert max(epsilon.sup_relative, epsilon_prime.sup_relative) < 1e-8


def test_linear_quadratic_game_has_the_riccati_solution() -> None:
    problem, monomials, _ = linear_quadratic()
    solver = OfflineSolver(problem, OfflineSettings(horizon=60.0, intervals=20, aligned=False))
    solved = [solver.solve(zeta) for zeta in states(12, HALF_WIDTHS, 5)]
    pairs = Pairs(
        np.array([solution.direct.zeta for solution in solved]),
        np.array([solution.value for solution in solved]),
        np.array([solution.costate for solution in solved]),
    )
    found = fit_weights(monomials, pairs)
    P = np.zeros((12, 12))
    P[np.triu_indices(12)] = found.weights
    P = 0.5 * (P + P.T) / np.outer(HALF_WIDTHS, HALF_WIDTHS)
    error = np.linalg.norm(P - problem.P) / np.linalg.norm(problem.P)
    assert error < 1e-6
    assert found.norm < 1e-7


def test_the_norm_is_the_one_that_is_documented_and_least() -> None:
    monomials, pairs = basis("quadratic"), bent()
    found = fit_weights(monomials, pairs)
    assert found.norm == pytest.approx(norm_by_hand(monomials, found.weights, pairs), rel=1e-10)
    rng = np.random.default_rng(0)
    for size in (1e-4, 1e-2, 1.0):
        other = found.weights + size * rng.standard_normal(78)
        assert norm_by_hand(monomials, other, pairs) > found.norm


def test_more_functions_never_fit_worse() -> None:
    pairs = bent()
    norms = [fit_weights(basis(name), pairs).norm for name in ("quadratic", "drag", "drag-cubic")]
    assert norms[0] > norms[1] > norms[2] > 0.0
    zeta, kept = SX.sym("zeta", 12), []
    for n in (20, 40, 60, 78):
        part = Basis.build(f"{n}", lambda x, n=n: quadratic(x)[:n], zeta, HALF_WIDTHS)
        kept.append(fit_weights(part, pairs).norm)
    assert kept == sorted(kept, reverse=True)
    assert kept[-1] == pytest.approx(norms[0], rel=1e-12)


def test_collinear_functions_share_the_weight() -> None:
    zeta, pairs = SX.sym("zeta", 12), bent()
    twice = Basis.build(
        "twice", lambda x: casadi.vertcat(quadratic(x), quadratic(x)), zeta, HALF_WIDTHS
    )
    once, found = fit_weights(basis("quadratic"), pairs), fit_weights(twice, pairs)
    assert found.norm == pytest.approx(once.norm, rel=1e-9)
    both = found.weights[:78] + found.weights[78:]
    np.testing.assert_allclose(both, once.weights, rtol=1e-8, atol=1e-9)
    # only the ridge, 1e-10, holds the difference against the rounding of the rows
    np.testing.assert_allclose(found.weights[:78], 0.5 * both, atol=1e-5)


def test_a_function_that_is_zero_has_no_weight() -> None:
    zeta = SX.sym("zeta", 12)
    padded = Basis.build("0", lambda x: casadi.vertcat(quadratic(x), 0 * x[0]), zeta, HALF_WIDTHS)
    found = fit_weights(padded, bent())
    assert found.weights[-1] == 0.0
    np.testing.assert_allclose(found.weights[:-1], fit_weights(basis("quadratic"), bent()).weights)


def test_small_states_count_as_much_as_large_ones() -> None:
    """Each pair shrunk by a factor of its own, V by its square, leaves a quadratic fit alone."""
    pairs = bent()
    shrink = 10.0 ** np.random.default_rng(1).uniform(-4.0, 0.0, (60, 1))
    shrunk = Pairs(pairs.states * shrink, pairs.values * shrink[:, 0] ** 2, pairs.gradients * shrink)
    expected = fit_weights(basis("quadratic"), pairs)
    found = fit_weights(basis("quadratic"), shrunk)
    np.testing.assert_allclose(found.weights, expected.weights, rtol=1e-8, atol=1e-10)


def test_errors_by_hand() -> None:
    monomials, pairs = basis("drag"), bent(3, 5)
    weights = np.random.default_rng(2).standard_normal(144)
    epsilon, epsilon_prime = representation_errors(monomials, weights, pairs)
    sigma = casadi.Function("sigma", [monomials.zeta], [monomials.sigma])
    value = [float(weights @ np.array(sigma(zeta)).ravel()) for zeta in pairs.states]
    np.testing.assert_allclose(epsilon, pairs.values - value, rtol=1e-12)
    for i, step in enumerate(1e-6 * HALF_WIDTHS):
        ahead, behind = (
            [float(weights @ np.array(sigma(zeta)).ravel()) for zeta in pairs.states + move]
            for move in (step * np.eye(12)[i], -step * np.eye(12)[i])
        )
        slope = (np.array(ahead) - np.array(behind)) / (2.0 * step)
        np.testing.assert_allclose(
            epsilon_prime[:, i], pairs.gradients[:, i] - slope, rtol=1e-5, atol=1e-6
        )
    of_value, of_gradient = error_sizes(monomials, weights, pairs)
    assert of_value.sup == pytest.approx(max(abs(epsilon)))
    assert of_value.sup_relative == pytest.approx(max(abs(epsilon / pairs.values)))
    norms = [np.linalg.norm(row) for row in epsilon_prime]
    assert of_gradient.sup == pytest.approx(max(norms))
    assert of_gradient.rms == pytest.approx(np.sqrt(sum(n**2 for n in norms) / 5))
    relative = [
        np.linalg.norm(e * HALF_WIDTHS) / np.linalg.norm(g * HALF_WIDTHS)
        for e, g in zip(epsilon_prime, pairs.gradients, strict=True)
    ]
    assert of_gradient.rms_relative == pytest.approx(np.sqrt(sum(r**2 for r in relative) / 5))


def test_sizes() -> None:
    size = ErrorSize.of(np.array([-3.0, 4.0]), np.array([0.1, -0.2]))
    assert size == ErrorSize(4.0, np.sqrt(12.5), 0.2, np.sqrt(0.025))


def test_basis_at_points() -> None:
    sigma, sigma_prime = basis_at(basis("quadratic"), HALF_WIDTHS[None, :] * [[1.0], [2.0]])
    assert sigma.shape == (2, 78)
    assert sigma_prime.shape == (2, 78, 12)
    np.testing.assert_allclose(sigma, [[1.0] * 78, [4.0] * 78])
    np.testing.assert_allclose(sigma_prime[0, 0], np.eye(12)[0] * 2.0 / HALF_WIDTHS[0])
    np.testing.assert_allclose(sigma_prime[0, 1], (np.eye(12)[0] / 2 + np.eye(12)[1] / 2))


def test_too_few_states(one_sentence: Check) -> None:
    """13 equations a state; but 11 states leave a quadratic form free along the one other direction."""
    assert least_states(basis("quadratic")) == 12
    assert least_states(basis("drag")) == 12
    assert least_states(basis("drag-cubic")) == 21
    for name, least in (("quadratic", 12), ("drag-cubic", 21)):
        few = Pairs(*(part[: least - 1] for part in vars(bent()).values()))
        with pytest.raises(InputError, match="don't determine") as caught:
            fit_weights(basis(name), few)
        assert f"at least {least}" in one_sentence(caught.value)
    # the gradients alone: V is half of ζ'V_ζ for a quadratic form and tells nothing more
    for n, rank in ((11, 77), (12, 78)):
        _, sigma_prime = basis_at(basis("quadratic"), bent().states[:n])
        rows = (sigma_prime * HALF_WIDTHS).transpose(0, 2, 1).reshape(-1, 78)
        assert np.linalg.matrix_rank(rows) == rank


@pytest.mark.parametrize("name", ["the station", "NaN", "a negative value", "shapes", "nothing"])
def test_pairs_that_can_not_be_fitted(name: str, one_sentence: Check) -> None:
    zeta, value, gradient = bent().states.copy(), bent().values.copy(), bent().gradients.copy()
    if name == "the station":
        zeta[3], value[3], gradient[3] = 0.0, 0.0, 0.0
    elif name == "NaN":
        gradient[4, 4] = np.nan
    elif name == "a negative value":
        value[0] = -1.0
    elif name == "shapes":
        value = value[:-1]
    else:
        zeta, value, gradient = zeta[:0], value[:0], gradient[:0]
    with pytest.raises(InputError) as caught:
        Pairs(zeta, value, gradient)
    one_sentence(caught.value)
