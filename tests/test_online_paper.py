"""The paper's page (13)-(21) = formulae at one point = the learner = its vector code.

On the exact two-state game and on the vehicle, with the disturbance player and without (γ infinite).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from stationkeep.online import Learner, LearnerSettings, draw_samples, paper
from stationkeep.online.paper import BellmanTerms, Projection, Residual
from stationkeep.symbolic import Basis, Problem, ValueFunctions
from stationkeep.symbolic.compiled.compilation import find_compiler

from .games import Array, quick_scenario, random_weights, two_state

GAMES = ("two states", "two states, γ infinite", "vehicle", "vehicle, γ infinite")
CODES = [
    "numpy",
    pytest.param(
        "vector", marks=pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler")
    ),
]
GAIN = 0.7  # η_c
ACTOR_GAINS = (0.9, 0.4)
PRINTED = LearnerSettings(
    rule="gradient",
    error="bellman",
    safeguard=False,
    normalizer="paper",
    leash=0.0,
    gain_critic=GAIN,
    gain_actor_1=ACTOR_GAINS[0],
    gain_actor_2=ACTOR_GAINS[1],
)


@cache
def game(name: str) -> tuple[Problem, Basis, Array]:
    """Return problem, basis and weights of its quadratic value."""
    if name.startswith("vehicle"):
        setup = quick_scenario().station_keeping()
        problem, basis = setup.problem, setup.basis
    else:
        problem, basis, _ = two_state()
    if name.endswith("infinite"):
        problem = problem.with_game(problem.game.single_player())
    return problem, basis, basis.quadratic_weights(problem.P)


@cache
def functions(name: str, code: str) -> ValueFunctions:
    problem, basis, _ = game(name)
    return ValueFunctions(problem, basis, compiled=code == "vector")


def weights(name: str) -> tuple[Array, Array, Array]:
    """Return a critic and two actors, all different, near the quadratic value's."""
    _, basis, exact = game(name)
    size = 0.2 * float(np.abs(exact).mean())
    critic, actor_1, actor_2 = (exact + size * w for w in random_weights(3, basis.n_basis))
    return critic, actor_1, actor_2


def state(name: str) -> Array:
    problem = game(name)[0]
    rng = np.random.default_rng(8)
    return np.asarray(0.3 * problem.scale * rng.uniform(-1.0, 1.0, problem.n_states))


def samples(name: str, number: int = 90) -> Array:
    return draw_samples(0.5 * game(name)[0].scale, number, seed=2)


def learner(name: str, code: str, number: int = 90) -> Learner:
    """Return a learner of the printed law at `weights`."""
    problem, basis, exact = game(name)
    found = Learner(problem, basis, PRINTED, samples(name, number), exact, None, functions(name, code))
    found.critic, found.actor_1, found.actor_2 = weights(name)
    return found


def terms(name: str, points: Array) -> BellmanTerms:
    return BellmanTerms.at(points, functions(name, "numpy").at(points), game(name)[0].game)


def residual(name: str, points: Array, critic: Array) -> Residual:
    """Return the paper's (17) at points under a critic and the actors of `weights`."""
    return paper.bellman_error(terms(name, points), game(name)[0].game, critic, *weights(name)[1:])


def rate(name: str, critic: Array) -> Array:
    """Return the paper's (19) at a critic."""
    here, there = state(name)[None, :], samples(name)
    return paper.critic_rate(residual(name, here, critic), residual(name, there, critic), GAIN)


def close(found: Array, expected: Array, tolerance: float) -> None:
    assert np.linalg.norm(found - expected) <= tolerance * np.linalg.norm(expected)


@pytest.mark.parametrize("name", GAMES)
def test_the_page_is_each_formula_at_each_point(name: str) -> None:
    """(14)-(19) from f, g, σ', Q, R and W_d, one point after another."""
    problem = game(name)[0]
    Q, R, gamma = problem.game.Q, problem.game.R, problem.game.gamma
    critic, actor_1, actor_2 = weights(name)
    points = np.vstack([state(name), samples(name, 5)])
    at = functions(name, "numpy").at(points)
    found = residual(name, points, critic)
    u_1 = paper.control_policy(terms(name, points), actor_1, problem.game)
    u_2 = paper.disturbance_policy(terms(name, points), actor_2, problem.game)
    expected = np.zeros(len(critic))
    for j, zeta in enumerate(points):
        f, g, sigma_prime = at.f[j], at.g[j], at.sigma_prime[j]
        control = -0.5 * np.linalg.solve(R, g.T @ sigma_prime.T @ actor_1)
        disturbance = np.zeros(len(control))
        if np.isfinite(gamma):
            push = g.T @ sigma_prime.T @ actor_2
            disturbance = np.linalg.solve(problem.game.W_d, push) / (2.0 * gamma**2)
        omega = sigma_prime @ (f + g @ (control + disturbance))
        cost = zeta @ Q @ zeta + control @ R @ control
        if np.isfinite(gamma):
            cost -= gamma**2 * disturbance @ problem.game.W_d @ disturbance
        delta = cost + critic @ omega
        size = abs(cost) + np.abs(omega) @ np.abs(critic)
        np.testing.assert_allclose(u_1[j], control, atol=1e-12 * np.abs(control).max())
        np.testing.assert_allclose(u_2[j], disturbance, atol=1e-12 * np.abs(control).max())
        np.testing.assert_allclose(found.omega[j], omega, atol=1e-12 * np.abs(omega).max())
        assert found.local_cost[j] == pytest.approx(cost, abs=1e-12 * size)
        assert found.delta[j] == pytest.approx(delta, abs=1e-12 * size)
        expected -= GAIN * omega * delta / np.sqrt(1.0 + omega @ omega)
    first, rest = (residual(name, part, critic) for part in (points[:1], points[1:]))
    close(paper.critic_rate(first, rest, GAIN), expected, 1e-11)


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("name", GAMES)
def test_the_learner_has_the_value_and_the_policies_of_the_page(name: str, code: str) -> None:
    found, zeta = learner(name, code), state(name)
    sigma = functions(name, "numpy").sigma(zeta)[0]
    assert found.value(zeta) == pytest.approx(float(paper.value(sigma, found.critic)), rel=1e-12)
    here, of_game = terms(name, zeta[None, :]), game(name)[0].game
    u_1, u_2 = found.policies(zeta)
    expected = paper.control_policy(here, found.actor_1, of_game)[0]
    np.testing.assert_allclose(u_1, expected, atol=1e-12 * np.abs(expected).max())
    disturbance = paper.disturbance_policy(here, found.actor_2, of_game)[0]
    np.testing.assert_allclose(u_2, disturbance, atol=1e-12 * np.abs(expected).max())
    assert np.any(u_2) == (not name.endswith("infinite"))


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("name", GAMES)
def test_the_learner_sees_the_bellman_error_of_the_page(name: str, code: str) -> None:
    found, zeta = learner(name, code), state(name)
    seen = found.observe(zeta)
    here = residual(name, zeta[None, :], found.critic)
    there = residual(name, samples(name), found.critic)
    assert seen.bellman_error == pytest.approx(here.delta[0], rel=1e-10)
    relative = there.delta / terms(name, samples(name)).state_cost
    assert seen.sample_error == pytest.approx(np.sqrt(np.mean(relative**2)), rel=1e-10)
    kept = found.sample_residual()
    assert kept is not None
    np.testing.assert_array_equal(kept.omega, there.omega)
    assert paper.rank_margin(kept.omega) > 0.0


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("name", GAMES)
def test_the_learner_follows_the_rates_of_the_page(name: str, code: str) -> None:
    """b = -Ŵ_c_dot of (19) is what the step's flow begins with; A = η_c Σ ω ω'/p is its slope."""
    found, zeta = learner(name, code), state(name)
    before, rows = weights(name), found.observe(zeta).rows
    close(-rows.gradient, rate(name, found.critic), 1e-11)
    shift = random_weights(4, len(before[0]))[0]
    slope = rate(name, found.critic + shift) - rate(name, found.critic)
    close(-rows.matrix @ shift, slope, 1e-9)
    dt = 1e-6 / float(np.linalg.eigvalsh(rows.matrix)[-1])
    found.step(zeta, dt)
    close((found.critic - before[0]) / dt, rate(name, before[0]), 1e-5)
    for after, start, gain in zip((found.actor_1, found.actor_2), before[1:], ACTOR_GAINS, strict=True):
        expected = paper.actor_rate(start, before[0], gain, found.projection)
        close((after - start) / dt, expected, 1e-5)


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("name", GAMES[:2])
def test_a_step_is_the_flow_of_the_page_with_frozen_rows(name: str, code: str) -> None:
    """Rows under the actors of the start; then the actors, under the critic of the end."""
    found, dt = learner(name, code), 0.2
    before = weights(name)
    found.step(state(name), dt)
    flow = solve_ivp(
        lambda t, critic: rate(name, critic), (0.0, dt), before[0], "DOP853", rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose(found.critic, flow.y[:, -1], atol=1e-8)
    for after, start, gain in zip((found.actor_1, found.actor_2), before[1:], ACTOR_GAINS, strict=True):
        moved = solve_ivp(
            lambda t, actor, gain=gain: paper.actor_rate(actor, found.critic, gain, found.projection),
            (0.0, dt),
            start,
            "DOP853",
            rtol=1e-11,
            atol=1e-12,
        )
        np.testing.assert_allclose(after, moved.y[:, -1], atol=1e-9)


def test_an_actor_beyond_the_bound_is_held_back_as_the_page_says() -> None:
    """In the layer of the projection a short step is the projected rate, not the plain one."""
    name, dt = "two states", 1e-7
    found = learner(name, "numpy")
    ball = found.projection
    start = weights(name)[1] * (ball.bound + 0.7 * ball.margin) / np.linalg.norm(weights(name)[1])
    found.actor_1, found.critic = start, 10.0 * start
    found.step(state(name), dt)
    plain = ACTOR_GAINS[0] * 9.0 * start
    held = paper.actor_rate(start, 10.0 * start, ACTOR_GAINS[0], ball)
    assert held @ start < 0.9 * plain @ start
    close((found.actor_1 - start) / dt, held, 1e-4)


def test_no_sample_is_an_empty_sum() -> None:
    name = "two states"
    here = residual(name, state(name)[None, :], weights(name)[0])
    none = Residual(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    assert len(none) == 0
    p = np.sqrt(1.0 + here.omega[0] @ here.omega[0])
    expected = -here.omega[0] * here.delta[0] / p
    np.testing.assert_allclose(paper.critic_rate(here, none, 1.0), expected, rtol=1e-14)
    assert paper.rank_margin(none.omega) == 0.0


def test_actors_at_the_critic_rest() -> None:
    critic = np.array([0.3, -0.2, 0.5])
    rest = paper.actor_rate(critic, critic, 3.0, Projection(bound=2.0, margin=0.2))
    np.testing.assert_array_equal(rest, np.zeros(3))
