"""Critic laws: exact steps of (19) and of least squares with forgetting, and its bounded covariance."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from stationkeep.online import Learner, LearnerSettings, draw_samples
from stationkeep.online.laws import Gradient, LeastSquares, NormalEquations, row_weights

from .games import TWO_STATE_WEIGHTS, Array, plain, two_state

M = 6


def random_rows(seed: int, n_rows: int = 15, spread: float = 2.0) -> tuple[Array, Array, Array]:
    """Return regressors whose sizes span 10^±spread, their costs r and positive weights w."""
    rng = np.random.default_rng(seed)
    omega = rng.standard_normal((n_rows, M)) * 10.0 ** rng.uniform(-spread, spread, M)
    return omega, rng.standard_normal(n_rows), rng.uniform(0.1, 2.0, n_rows)


def equations(rows: tuple[Array, Array, Array], critic: Array) -> NormalEquations:
    omega, cost, weights = rows
    return NormalEquations.of(omega, cost + omega @ critic, weights, np.zeros(M), np.zeros(M))


def nothing() -> NormalEquations:
    """Rows that say nothing."""
    return NormalEquations(np.zeros((M, M)), np.zeros(M), np.zeros(M))


@pytest.mark.parametrize("dt", [1e-4, 0.1, 10.0])
@pytest.mark.parametrize("n_rows", [3, 15])
def test_gradient_step_is_the_flow_of_frozen_rows(dt: float, n_rows: int) -> None:
    """dW/dt = -Σ w ω (r + ω'W): the exponential of the linear flow, singular or not."""
    rows = random_rows(1, n_rows)
    omega, cost, weights = rows
    start = np.random.default_rng(2).standard_normal(M)
    A, b = (omega.T * weights) @ omega, (omega.T * weights) @ cost
    flow = scipy.linalg.expm(dt * np.block([[-A, -b[:, None]], [np.zeros((1, M + 1))]]))
    expected = (flow @ np.append(start, 1.0))[:M]
    answer = Gradient().step(start, equations(rows, start), dt)
    np.testing.assert_allclose(answer, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_gradient_step_against_an_integrator() -> None:
    rows = random_rows(3, spread=0.7)
    omega, cost, weights = rows
    start = np.random.default_rng(4).standard_normal(M)
    answer = solve_ivp(
        lambda t, W: -(weights * (cost + omega @ W)) @ omega,
        (0.0, 0.3),
        start,
        "DOP853",
        rtol=1e-12,
        atol=1e-12,
    )
    np.testing.assert_allclose(
        Gradient().step(start, equations(rows, start), 0.3), answer.y[:, -1], atol=1e-10
    )


def test_gradient_step_composes() -> None:
    """Two half steps with frozen rows are one step."""
    rows = random_rows(5)
    start = np.ones(M)
    half = Gradient().step(start, equations(rows, start), 0.05)
    whole = Gradient().step(start, equations(rows, start), 0.1)
    np.testing.assert_allclose(Gradient().step(half, equations(rows, half), 0.05), whole, rtol=1e-9)


def printed_rate(learner: Learner, zeta: Array, samples: Array, gain: float) -> Array:
    """Return (19): -η_c ω δ / p - η_c Σ ω_j δ_j / p_j, one point after another."""
    problem, _, functions = two_state()
    game, rate = problem.game, np.zeros(3)
    for point in (zeta, *samples):
        here = functions.at(point[None, :])
        f, g, sigma_prime = here.f[0], here.g[0], here.sigma_prime[0]
        u_1, u_2 = learner.policies(point)
        omega = sigma_prime @ (f + g @ (u_1 + u_2))
        delta = float(game.local_cost(point, u_1, u_2)) + learner.critic @ omega
        rate -= gain * omega * delta / np.sqrt(1.0 + omega @ omega)
    return rate


def test_a_short_learning_step_is_eulers_step_of_the_printed_law() -> None:
    problem, basis, functions = two_state()
    samples = draw_samples(np.ones(2), 12, seed=0)
    start, zeta, dt = np.array([0.9, 0.3, 1.5]), np.array([0.6, -0.4]), 1e-7
    printed = LearnerSettings.as_printed(gain_critic=0.7)
    learner = Learner(problem, basis, printed, samples, TWO_STATE_WEIGHTS, start, functions)
    learner.actor_1, learner.actor_2 = np.array([0.8, 0.1, 1.2]), np.array([0.5, -0.1, 0.9])
    rate = printed_rate(learner, zeta, samples, 0.7)
    learner.step(zeta, dt)
    np.testing.assert_allclose((learner.critic - start) / dt, rate, rtol=1e-5)


def test_a_gain_of_the_sample_rows() -> None:
    """Another gain for the samples scales their part of (19) and nothing else."""
    problem, basis, functions = two_state()
    samples = draw_samples(np.ones(2), 12, seed=0)
    start, zeta, dt = np.array([0.9, 0.3, 1.5]), np.array([0.6, -0.4]), 1e-7

    def rate(points: Array, **options: float) -> Array:
        chosen = LearnerSettings.as_printed(**options)
        learner = Learner(problem, basis, chosen, points, TWO_STATE_WEIGHTS, start, functions)
        learner.step(zeta, dt)
        return (learner.critic - start) / dt

    state_only = rate(np.empty((0, 2)))
    of_samples = rate(samples) - state_only
    tripled = rate(samples, gain_samples=3.0)
    np.testing.assert_allclose(tripled, state_only + 3.0 * of_samples, rtol=1e-5)
    only_samples = rate(samples, gain_critic=0.0, gain_samples=1.0)
    np.testing.assert_allclose(only_samples, of_samples, rtol=1e-5)


def test_row_weights() -> None:
    omega, state_cost = np.array([[3.0, 4.0], [0.0, 0.0]]), np.array([2.0, 0.0])
    p = np.sqrt(26.0)
    np.testing.assert_allclose(row_weights("paper", omega, state_cost, 0.5), [1.0 / p, 1.0])
    np.testing.assert_allclose(row_weights("state_cost", omega, state_cost, 0.5), [0.16, 4.0])


@pytest.mark.parametrize("forgetting", [0.0, 0.8])
def test_least_squares_minimises_its_discounted_cost(forgetting: float) -> None:
    """All past rows at once, each with weight c e^{-β (t - t_k)}, by numpy's lstsq."""
    steps, covariance = np.array([0.3, 0.1, 0.7, 0.2, 0.5]), 50.0
    law = LeastSquares(M, forgetting, covariance, np.inf)
    start = np.random.default_rng(9).standard_normal(M)
    critic, design, target = start, [np.eye(M) / np.sqrt(covariance)], [start / np.sqrt(covariance)]
    for k, dt in enumerate(steps):
        # few rows a step, so that none of them determines the weights alone
        rows = random_rows(20 + k, n_rows=2, spread=0.5)
        critic = law.step(critic, equations(rows, critic), dt)
        faded = np.exp(-0.5 * forgetting * dt)
        design, target = [faded * a for a in design], [faded * y for y in target]
        held = -np.expm1(-forgetting * dt) / forgetting if forgetting else dt
        omega, cost, weights = rows
        root = np.sqrt(held * weights)
        design.append(root[:, None] * omega)
        target.append(-root * cost)
        expected, *_ = np.linalg.lstsq(np.vstack(design), np.concatenate(target), rcond=None)
        np.testing.assert_allclose(critic, expected, rtol=1e-8, atol=1e-9)
        information = np.vstack(design).T @ np.vstack(design)
        np.testing.assert_allclose(law.information, information, rtol=1e-9, atol=1e-12)


def test_least_squares_is_the_flow_of_its_law() -> None:
    """Ŵ_c_dot = -Γ Σ w ω δ, Γ_dot = β Γ - Γ (Σ w ω ω') Γ, integrated by scipy."""
    rows = random_rows(6, n_rows=4, spread=0.3)
    omega, cost, weights = rows
    beta, dt, start = 0.9, 0.4, np.ones(M)
    A = (omega.T * weights) @ omega

    def law(t: float, y: Array) -> Array:
        W, covariance = y[:M], y[M:].reshape(M, M)
        W_dot = -covariance @ ((weights * (cost + omega @ W)) @ omega)
        return np.append(W_dot, (beta * covariance - covariance @ A @ covariance).ravel())

    y0 = np.append(start, (2.0 * np.eye(M)).ravel())
    answer = solve_ivp(law, (0.0, dt), y0, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    squares = LeastSquares(M, beta, 2.0, np.inf)
    critic = squares.step(start, equations(rows, start), dt)
    np.testing.assert_allclose(critic, answer[:M], rtol=1e-8)
    np.testing.assert_allclose(
        np.linalg.inv(squares.information), answer[M:].reshape(M, M), rtol=1e-7, atol=1e-9
    )


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    rank=st.integers(0, M - 1),
    forgetting=st.floats(0.0, 4.0),
    product=st.floats(1e-3, 1.0),
    share=st.floats(1e-3, 1.0),
)
def test_covariance_never_exceeds_its_bound(
    seed: int, rank: int, forgetting: float, product: float, share: float
) -> None:
    """Long runs with rows that say nothing, or nothing in most directions; β dt <= 1."""
    bound = 1e4
    law = LeastSquares(M, forgetting, share * bound, bound)
    dt = product / forgetting if forgetting > product else product
    omega, cost, weights = random_rows(seed, max(rank, 1), spread=1.0)
    rows = (omega, cost, weights if rank else 0.0 * weights)
    critic = np.zeros(M)
    for _ in range(100):
        critic = law.step(critic, equations(rows, critic), dt)
        # an eigenvalue of 1/bound is known to rounding of the largest one
        rounding = 1e-14 * bound * float(np.linalg.norm(law.information))
        assert law.covariance_norm <= bound * (1.0 + 1e-9 + rounding)
    assert np.all(np.isfinite(critic))


def test_covariance_reaches_its_bound_without_data() -> None:
    """Forgetting goes on until there is nothing left to forget, so the bound is what limits it."""
    law = LeastSquares(M, 2.0, 1e2, 1e4)
    for _ in range(60):
        law.step(np.zeros(M), nothing(), 0.25)
    assert law.covariance_norm == pytest.approx(1e4, rel=1e-3)


@pytest.mark.parametrize("dt", [0.26, 1.0, 3.0, 20.0])
def test_covariance_stays_bounded_after_a_late_step(dt: float) -> None:
    """A caller may be late: the time between learning steps is what passed, not what was planned."""
    law = LeastSquares(M, 4.0, 10.0, 1e4)
    largest = 0.0
    for _ in range(30):
        law.step(np.zeros(M), nothing(), dt)
        largest = max(largest, law.covariance_norm)
    assert largest <= 1e4 * (1.0 + 1e-9)


def test_settings_refuse_what_would_not_stay_bounded() -> None:
    with pytest.raises(ValueError, match=r"forgetting \* period"):
        LearnerSettings(forgetting=5.0, period=0.25)
    with pytest.raises(ValueError, match="covariance_bound"):
        LearnerSettings(covariance=1e9)


def leashed(critic: Array, reference: Array, strength: float) -> NormalEquations:
    none = np.zeros((0, M)), np.zeros(0), np.zeros(0)
    return NormalEquations.of(*none, np.full(M, strength), critic - reference)


def test_leash_pulls_to_the_reference_when_there_are_no_data() -> None:
    reference, start = np.linspace(1.0, 2.0, M), np.zeros(M)
    moved = Gradient().step(start, leashed(start, reference, 0.5), 3.0)
    np.testing.assert_allclose(moved - reference, np.exp(-1.5) * (start - reference), rtol=1e-12)
    law, critic = LeastSquares(M, 1.0, 1e2, 1e4), start
    for _ in range(40):
        critic = law.step(critic, leashed(critic, reference, 0.5), 0.25)
    np.testing.assert_allclose(critic, reference, atol=1e-5)


def test_leash_is_relative_to_what_the_samples_know() -> None:
    """Strong, it keeps the reference; weak, the data win; absent, they are alone."""
    problem, basis, functions = two_state()
    reference = np.array([0.7, 0.1, 1.2])
    gap = []
    for leash in (0.0, 1e-3, 1e6):
        chosen = plain(leash=leash)
        samples = draw_samples(np.ones(2), 100, seed=0)
        learner = Learner(problem, basis, chosen, samples, reference, None, functions)
        for _ in range(80):
            learner.step(np.zeros(2), 0.25)
        gap.append(float(np.linalg.norm(learner.critic - TWO_STATE_WEIGHTS)))
    whole = float(np.linalg.norm(reference - TWO_STATE_WEIGHTS))
    assert gap[0] < 1e-6
    assert 1e-6 < gap[1] < 0.1 * whole
    assert gap[2] == pytest.approx(whole, rel=1e-3)
