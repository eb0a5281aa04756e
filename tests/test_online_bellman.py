"""The Bellman error (17): against loops at one point, its unmeasurable form (22), and exact games."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from stationkeep.online.paper import BellmanTerms, bellman_error
from stationkeep.symbolic import Basis, Game, Problem, ValueFunctions

from .games import TWO_STATE_WEIGHTS, Array, linear_quadratic, quick_scenario, random_weights, two_state

Setup = tuple[Problem, Basis, ValueFunctions]


def vehicle() -> Setup:
    """The shipped game on the shipped vehicle, with drag."""
    setup = quick_scenario().station_keeping()
    return setup.problem, setup.basis, setup.functions


def coupled() -> Setup:
    """The linear plant under a game whose R and W_d are full and differ."""
    problem, basis, _ = linear_quadratic()
    A, B = np.random.default_rng(5).standard_normal((2, 6, 6))
    R, W_d = np.eye(6) + 0.1 * A @ A.T, 2.0 * np.eye(6) + 0.1 * B @ B.T
    changed = problem.with_game(Game(problem.game.Q, R, W_d, 3.0))
    return changed, basis, ValueFunctions(changed, basis, compiled=False)


def states(problem: Problem, n_points: int, seed: int = 3) -> Array:
    """Return seeded states of the envelope."""
    rng = np.random.default_rng(seed)
    return problem.scale * rng.uniform(-1.0, 1.0, (n_points, problem.n_states))


def terms_at(setup: Setup, points: Array) -> BellmanTerms:
    problem, _, functions = setup
    return BellmanTerms.at(points, functions.at(points), problem.game)


def quadratic_form(x: Array, weight: Array) -> float:
    """Return x'A x, written out."""
    n = len(x)
    return float(sum(x[i] * weight[i, j] * x[j] for i in range(n) for j in range(n)))


def by_hand(
    setup: Setup, zeta: Array, critic: Array, actor_1: Array, actor_2: Array
) -> tuple[Array, float, float]:
    """Return ω, r and δ of (14)-(17) at one point, one sum at a time."""
    problem, basis, functions = setup
    game, n, k, m = problem.game, problem.n_states, problem.n_inputs, basis.n_basis
    here = functions.at(zeta[None, :])
    f, g, sigma_prime = (np.array(a[0]) for a in (here.f, here.g, here.sigma_prime))
    R_inverse = np.linalg.inv(game.R)
    W_inverse = np.linalg.inv(game.W_d)
    gradient_1 = np.array([sum(sigma_prime[b, i] * actor_1[b] for b in range(m)) for i in range(n)])
    gradient_2 = np.array([sum(sigma_prime[b, i] * actor_2[b] for b in range(m)) for i in range(n)])
    push_1 = np.array([sum(g[i, j] * gradient_1[i] for i in range(n)) for j in range(k)])
    push_2 = np.array([sum(g[i, j] * gradient_2[i] for i in range(n)) for j in range(k)])
    u_1, u_2 = np.zeros(k), np.zeros(k)
    for j in range(k):
        for q in range(k):
            u_1[j] -= 0.5 * R_inverse[j, q] * push_1[q]
            u_2[j] += 0.5 / game.gamma**2 * W_inverse[j, q] * push_2[q]
    zeta_dot = np.array([f[i] + sum(g[i, j] * (u_1[j] + u_2[j]) for j in range(k)) for i in range(n)])
    omega = np.array([sum(sigma_prime[b, i] * zeta_dot[i] for i in range(n)) for b in range(m)])
    cost = quadratic_form(zeta, game.Q) + quadratic_form(u_1, game.R)
    cost -= game.gamma**2 * quadratic_form(u_2, game.W_d)
    return omega, cost, cost + sum(omega[b] * critic[b] for b in range(m))


@pytest.mark.parametrize("build", [two_state, linear_quadratic, coupled, vehicle])
def test_many_points_at_once_are_the_formula_at_each(build: Callable[[], Setup]) -> None:
    setup = build()
    problem, basis, _ = setup
    points = states(problem, 5)
    terms = terms_at(setup, points)
    for seed in range(3):
        weights = random_weights(seed, basis.n_basis)
        answer = bellman_error(terms, problem.game, *weights)
        for j, zeta in enumerate(points):
            omega, cost, delta = by_hand(setup, zeta, *weights)
            size = abs(cost) + np.abs(omega) @ np.abs(weights[0])
            np.testing.assert_allclose(answer.omega[j], omega, atol=1e-12 * np.abs(omega).max())
            assert answer.local_cost[j] == pytest.approx(cost, abs=1e-12 * size)
            assert answer.delta[j] == pytest.approx(delta, abs=1e-12 * size)


def test_the_hamiltonian_of_the_game_is_the_bellman_error() -> None:
    setup = vehicle()
    problem, basis, functions = setup
    critic, actor_1, actor_2 = random_weights(7, basis.n_basis)
    zeta = states(problem, 1)[0]
    here = functions.at(zeta[None, :])
    u_1, u_2 = functions.policies(zeta, actor_1, actor_2)
    hamiltonian = problem.game.hamiltonian(
        zeta, here.f[0], here.g[0], critic @ here.sigma_prime[0], u_1, u_2
    )
    answer = bellman_error(terms_at(setup, zeta[None, :]), problem.game, critic, actor_1, actor_2)
    assert answer.delta[0] == pytest.approx(hamiltonian, rel=1e-11)


def test_the_local_cost_takes_both_signs() -> None:
    setup = two_state()
    problem, basis, _ = setup
    terms = terms_at(setup, states(problem, 50))
    zero, loud = np.zeros(basis.n_basis), np.array([2.0, 0.0, 8.0])
    assert bellman_error(terms, problem.game, zero, loud, zero).local_cost.min() > 0.0
    assert bellman_error(terms, problem.game, zero, zero, loud).local_cost.min() < 0.0


def two_state_by_paper(zeta: Array) -> tuple[Array, Array, Array]:
    """Return f, g and σ' of the closed-form game, written from its formulae (R = 1, γ = 2)."""
    x_1, x_2 = zeta
    c, k = np.cos(2.0 * x_1) + 2.0, 1.0 - 0.25
    f = np.array([-x_1 + x_2, -x_1 / 2.0 - x_2 / 2.0 * (1.0 - k * c**2)])
    sigma_prime = np.array([[2.0 * x_1, 0.0], [x_2, x_1], [0.0, 2.0 * x_2]])
    return f, np.array([0.0, c]), sigma_prime


@pytest.mark.parametrize("seed", range(20))
def test_unmeasurable_form_of_the_bellman_error(seed: int) -> None:
    """(22) with ε = 0: δ = -W̃_c'ω + 1/4 W̃_a1'G_σ1 W̃_a1 - 1/4 W̃_a2'G_σ2 W̃_a2."""
    setup = two_state()
    rng = np.random.default_rng(seed)
    zeta = rng.uniform(-1.5, 1.5, 2)
    critic, actor_1, actor_2 = random_weights(seed, 3)
    measured = bellman_error(
        terms_at(setup, zeta[None, :]), setup[0].game, critic, actor_1, actor_2
    ).delta[0]
    f, g, sigma_prime = two_state_by_paper(zeta)
    G_sigma = sigma_prime @ np.outer(g, g) @ sigma_prime.T
    u = -0.5 * g @ sigma_prime.T @ actor_1 + 0.125 * g @ sigma_prime.T @ actor_2
    omega = sigma_prime @ (f + g * u)
    error_c, error_1, error_2 = (TWO_STATE_WEIGHTS - W for W in (critic, actor_1, actor_2))
    unmeasurable = (
        -error_c @ omega
        + 0.25 * error_1 @ G_sigma @ error_1
        - 0.25 * error_2 @ (G_sigma / 4.0) @ error_2
    )
    assert measured == pytest.approx(unmeasurable, rel=1e-12, abs=1e-12)


def test_closed_form_weights_have_no_bellman_error() -> None:
    setup = two_state()
    terms = terms_at(setup, states(setup[0], 200))
    exact = TWO_STATE_WEIGHTS
    answer = bellman_error(terms, setup[0].game, exact, exact, exact)
    assert np.abs(answer.delta).max() < 1e-12
    off = bellman_error(terms, setup[0].game, exact + 1e-3, exact, exact)
    assert np.abs(off.delta).max() > 1e-4


def test_riccati_weights_have_no_bellman_error_in_the_linear_game() -> None:
    setup = linear_quadratic()
    problem, basis, _ = setup
    weights = basis.quadratic_weights(problem.P)
    terms = terms_at(setup, states(problem, 300))
    answer = bellman_error(terms, problem.game, weights, weights, weights)
    assert np.abs(answer.delta / terms.state_cost).max() < 1e-10
    off = bellman_error(terms, problem.game, weights * (1.0 + 1e-6), weights, weights)
    assert np.abs(off.delta / terms.state_cost).max() > 1e-8


def test_terms_do_not_change_with_the_next_evaluation() -> None:
    setup = two_state()
    first, second = states(setup[0], 4, seed=1), states(setup[0], 4, seed=2)
    terms = terms_at(setup, first)
    kept = terms.sigma_f.copy(), terms.sigma_g.copy(), terms.state_cost.copy()
    terms_at(setup, second)
    for before, after in zip(kept, (terms.sigma_f, terms.sigma_g, terms.state_cost), strict=True):
        np.testing.assert_array_equal(before, after)
