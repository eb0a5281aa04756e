"""The UUB theorem on the exact two-state game: its bound, its constants, and what ε = 0 makes of it.

The laws (19)-(21) and V_L's derivative are written out here by hand, apart from the package's.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from stationkeep.comparison.study.game_run import GameRun, game_run
from stationkeep.comparison.theory.exact_basis import exact_bound
from stationkeep.comparison.theory.uub import (
    Gains,
    Knowledge,
    Suprema,
    admissible_gains,
    constants,
    distance,
    lyapunov,
    measure,
)
from stationkeep.online import Learner, LearnerSettings, draw_samples, rank_margin
from stationkeep.online.laws import Equations, LeastSquares
from stationkeep.symbolic import InputError

from .games import TWO_STATE_WEIGHTS, Array, plain, two_state

SAMPLES = draw_samples(np.ones(2), 100, seed=0)
GAINS = Gains(1.0, 3.0, 2.0)
FAR = (np.array([0.9, 0.3, 1.5]), np.array([0.4, -0.2, 0.8]), np.array([3.0, 1.0, 1.0]))


def disc(radius: float, n: int) -> Array:
    """Return seeded points of the disc |ζ| <= radius, its edge and its center among them."""
    rng = np.random.default_rng(5)
    angle = rng.uniform(0.0, 2.0 * np.pi, n)
    size = radius * np.concatenate([np.ones(n // 4), np.sqrt(rng.uniform(0.0, 1.0, n - n // 4))])
    return np.asarray(np.maximum(size, 1e-3)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


def knowledge(weights: Array, points: Array) -> Knowledge:
    """The closed form V = ζ_1^2/2 + ζ_2^2 and any weights, which leave ε = V - W'σ."""
    values = 0.5 * points[:, 0] ** 2 + points[:, 1] ** 2
    return Knowledge(weights, points, values, points * np.array([1.0, 2.0]))


def terms(zeta: Array) -> tuple[Array, Array, Array]:
    """Return f, g and σ' of the two-state game (R = 1, γ = 2, k = 3/4)."""
    x, y = zeta
    c = np.cos(2 * x) + 2
    f = np.array([-x + y, -x / 2 - y / 2 * (1 - 0.75 * c**2)])
    return f, np.array([0.0, c]), np.array([[2 * x, 0.0], [y, x], [0.0, 2 * y]])


def bellman(zeta: Array, critic: Array, actor_1: Array, actor_2: Array) -> tuple[Array, float]:
    """Return ω and δ of (17) at one state."""
    f, g, jacobian = terms(zeta)
    u_control = -0.5 * g @ jacobian.T @ actor_1
    u_disturbance = g @ jacobian.T @ actor_2 / 8.0
    omega = jacobian @ (f + g * (u_control + u_disturbance))
    cost = zeta @ zeta + u_control**2 - 4.0 * u_disturbance**2
    return omega, float(cost + critic @ omega)


def flow(z: Array, gains: Gains, *, disturbed: bool = True) -> Array:
    """Return the rates of (ζ, Ŵ_c, Ŵ_a1, Ŵ_a2) under (19)-(21), inside the projection's ball."""
    zeta, critic, actor_1, actor_2 = z[:2], z[2:5], z[5:8], z[8:]
    f, g, jacobian = terms(zeta)
    push = g @ jacobian.T
    u = -0.5 * push @ actor_1 + (push @ actor_2 / 8.0 if disturbed else 0.0)
    critic_rate = np.zeros(3)
    for point in (zeta, *SAMPLES):
        omega, delta = bellman(point, critic, actor_1, actor_2)
        critic_rate -= gains.critic * omega / np.sqrt(1.0 + omega @ omega) * delta
    rates = (gains.actor_1 * (critic - actor_1), gains.actor_2 * (critic - actor_2))
    return np.concatenate([f + g * u, critic_rate, *rates])


def lyapunov_rate(
    zeta: Array, errors: tuple[Array, Array, Array], weights: Array, *, disturbed: bool = True
) -> float:
    """Return V_L_dot along the flow, by the chain rule."""
    critic, actor_1, actor_2 = (weights - error for error in errors)
    rate = flow(np.concatenate([zeta, critic, actor_1, actor_2]), GAINS, disturbed=disturbed)
    value_rate = zeta * np.array([1.0, 2.0]) @ rate[:2]
    return float(value_rate - np.concatenate(errors) @ rate[2:])


def margin(actor_1: Array, actor_2: Array) -> float:
    return rank_margin(np.array([bellman(p, np.zeros(3), actor_1, actor_2)[0] for p in SAMPLES]))


def draws(n: int, size: float) -> Iterator[tuple[Array, Array, Array]]:
    """Yield weight errors of all sizes up to the given one."""
    rng = np.random.default_rng(8)
    for _ in range(n):
        errors = rng.standard_normal((3, 3))
        errors *= size * rng.uniform(0.0, 1.0, (3, 1)) / np.linalg.norm(errors, axis=1)[:, None]
        yield errors[0], errors[1], errors[2]


@pytest.mark.parametrize("weights", [TWO_STATE_WEIGHTS, np.array([0.6, 0.1, 0.85])])
def test_the_proof_bounds_the_rate(weights: Array) -> None:
    """With weights that are not ideal ε is what they leave, and everything is still exact."""
    points = disc(0.8, 120)
    found = measure(two_state()[2], knowledge(weights, points), SAMPLES)
    assert (found.epsilon_prime < 1e-12) == (weights is TWO_STATE_WEIGHTS)
    size = 0.4
    smallest = min(margin(weights - e[1], weights - e[2]) for e in draws(60, size))
    found_at = constants(found, GAINS, smallest, size)
    slack = []
    for zeta, errors in zip(points, draws(120, size), strict=True):
        norms = [float(np.linalg.norm(error)) for error in errors]
        bound = (
            -found_at.phi_zeta * zeta @ zeta
            - np.array([found_at.phi_c, found_at.phi_a1, found_at.phi_a2]) @ np.square(norms)
            + np.array([found_at.kappa_c, found.kappa_a1, found.kappa_a2]) @ norms
            + found.kappa
        )
        rate = lyapunov_rate(zeta, errors, weights)
        slack.append(float(bound) - rate)
        if np.sqrt(zeta @ zeta + np.square(norms).sum()) > found_at.radius_printed:
            assert rate < 0.0
    assert min(slack) > 0.0


def test_suprema_by_hand() -> None:
    weights, points = np.array([0.6, 0.1, 0.85]), disc(0.8, 60)
    found = measure(two_state()[2], knowledge(weights, points), SAMPLES)
    slopes, drifts, squares, crosses, kappas, rests = [], [], [], [], [], []
    for zeta in points:
        f, g, jacobian = terms(zeta)
        true = zeta * np.array([1.0, 2.0])
        error = true - jacobian.T @ weights
        G = np.outer(g, g)
        slopes.append(np.linalg.norm(error))
        drifts.append(np.linalg.norm(f) / np.linalg.norm(zeta))
        squares.append(np.linalg.eigvalsh(jacobian @ G @ jacobian.T)[-1])
        crosses.append(0.5 * np.linalg.norm(true @ G @ jacobian.T))
        kappas.append(0.25 * 0.75 * error @ G @ error)
        rests.append(abs(0.5 * 0.75 * error @ G @ jacobian.T @ weights + kappas[-1]))
    at_samples, residual = 0.0, 0.0
    for zeta in SAMPLES:
        _, g, jacobian = terms(zeta)
        at_samples += np.linalg.eigvalsh(jacobian @ np.outer(g, g) @ jacobian.T)[-1]
        residual += abs(bellman(zeta, weights, weights, weights)[1])
    assert found.q_lower == pytest.approx(1.0)
    assert found.drift == pytest.approx(max(drifts))
    assert found.epsilon_prime == pytest.approx(max(slopes))
    assert found.square_1 == pytest.approx(max(squares) + at_samples)
    assert found.square_2 == pytest.approx(0.25 * found.square_1)
    assert found.rest == pytest.approx(max(rests) + residual)
    assert found.kappa_a1 == pytest.approx(max(crosses))
    assert found.kappa_a2 == pytest.approx(0.25 * found.kappa_a1)
    assert found.kappa == pytest.approx(max(kappas))
    assert 0.5 <= found.value_lower < 0.51
    assert 0.99 < found.value_upper <= 1.0
    assert found.class_k == pytest.approx(np.sqrt(found.value_upper / 0.5), rel=1e-6)


def test_ideal_residual_is_E_of_23() -> None:
    """E_j = ε'Gσ'^T W / 2 + ε'Gε'^T / 4 - ε'f, which `measure` takes from δ_j at the ideal weights."""
    weights = np.array([0.6, 0.1, 0.85])
    for zeta in SAMPLES[:20]:
        f, g, jacobian = terms(zeta)
        error = zeta * np.array([1.0, 2.0]) - jacobian.T @ weights
        G = 0.75 * np.outer(g, g)
        E = 0.5 * error @ G @ jacobian.T @ weights + 0.25 * error @ G @ error - error @ f
        assert bellman(zeta, weights, weights, weights)[1] == pytest.approx(E, abs=1e-12)


def test_K_as_printed_and_corrected() -> None:
    """-(α_5/2) |Z|^2 needs K^2 twice as large; each φ half of what (24) and (25) leave."""
    found = Suprema(
        *(20.0, 4.0, 0.5, 100.0, 50.0, 7.0, 3.0, 2.0, 0.1),
        *(0.3, 5.0),
    )
    gains, c, size = Gains(0.8, 0.4, 0.2), 6.0, 1.5
    at = constants(found, gains, c, size)
    least, largest = 4.0 * 0.5 / (2.0 * (c - 0.6 / 1.6)), 2.0 * 20.0 / (0.8 * 4.0 * 0.5)
    assert at.free == pytest.approx(np.sqrt(least * largest))
    assert least < at.free < largest
    phi_c = 0.8 * (c - 2.0 / (2.0 * at.free) - 0.6 / 1.6)
    assert at.phi_zeta == pytest.approx(20.0 - 0.8 * 2.0 * at.free / 2.0)
    assert (at.phi_c, at.phi_a1, at.phi_a2) == pytest.approx((phi_c, 0.2, 0.1))
    alpha = min(at.phi_zeta, phi_c / 2, 0.1, 0.05)
    assert at.alpha_5 == pytest.approx(alpha)
    kappa_c = 0.8 * (100.0 / 4.0 * 1.5**2 + 7.0)
    assert at.kappa_c == pytest.approx(kappa_c)
    squared = kappa_c**2 / (2 * alpha * phi_c) + 9.0 / (2 * alpha * 0.2)
    squared += 4.0 / (2 * alpha * 0.1) + 0.1 / alpha
    assert at.radius_printed == pytest.approx(np.sqrt(squared))
    assert at.radius == pytest.approx(np.sqrt(2.0 * squared))
    assert constants(found, gains, 0.3, size).radius == np.inf, "(25) fails"


def test_admissible_gains_are_half_way() -> None:
    found = Suprema(20.0, 4.0, 0.5, 100.0, 50.0, 7.0, 3.0, 2.0, 0.1, 0.3, 5.0)
    c = 1e-6
    gains = admissible_gains(found, c)
    free = 4.0 * 0.5 / c
    assert gains.critic * 4.0 * 0.5 * free / 2.0 == pytest.approx(10.0)
    assert c - 2.0 / (2.0 * free) - (gains.actor_1 + gains.actor_2) / (2.0 * gains.critic) > 0.0
    at = constants(found, gains, c, 1.0)
    assert at.alpha_5 > 0.0
    assert np.isfinite(at.radius)


def level_points() -> Array:
    return disc(0.2, 120)


@pytest.mark.parametrize("disturbed", [True, False])
def test_an_exact_basis_makes_the_rate_negative(disturbed: bool) -> None:
    """Everywhere below the level, and the finer bound holds beyond it."""
    points, weights = level_points(), TWO_STATE_WEIGHTS
    smallest = min(margin(weights - e[1], weights - e[2]) for e in draws(60, 0.1))
    found = exact_bound(two_state()[2], points, SAMPLES, GAINS, smallest)
    radius = float(np.sqrt(2.0 * found.level))
    assert 0.03 < radius < 0.1
    assert np.sqrt(found.level / 0.5) < 0.2, "the level lies in the disc"
    slack = []
    for zeta, errors in zip(points, draws(120, 0.1), strict=True):
        squares = np.array([error @ error for error in errors])
        bound = -(1.0 - 0.5 * (found.lift_1 * squares[1] + found.lift_2 * squares[2])) * zeta @ zeta
        bound -= ((1.0 - found.theta) * smallest - 2.5) * squares[0]
        for gain, fourth, square in (
            (3.0, found.fourth_1, squares[1]),
            (2.0, found.fourth_2, squares[2]),
        ):
            bound -= (gain / 2.0 - fourth * square / (64.0 * found.theta)) * square
        slack.append(bound - lyapunov_rate(zeta, errors, weights, disturbed=disturbed))
        below = 0.5 * zeta[0] ** 2 + zeta[1] ** 2 + 0.5 * squares.sum()
        shrink = np.sqrt(0.99 * found.level / below)
        scaled = (shrink * errors[0], shrink * errors[1], shrink * errors[2])
        assert lyapunov_rate(shrink * zeta, scaled, weights, disturbed=disturbed) < 0.0
    assert min(slack) > 0.0


def test_without_25_there_is_no_exact_bound() -> None:
    with pytest.raises(InputError, match="slow the actors down"):
        exact_bound(two_state()[2], level_points(), SAMPLES, Gains(1.0, 9.0, 9.0), 7.0)


def learned(start: Array, zeta0: Array, gains: Gains, *, disturbed: bool, duration: float) -> GameRun:
    problem, basis, functions = two_state()
    settings = LearnerSettings.as_printed(
        gain_critic=gains.critic,
        gain_actor_1=gains.actor_1,
        gain_actor_2=gains.actor_2,
    )
    learner = Learner(problem, basis, settings, SAMPLES, TWO_STATE_WEIGHTS, start, functions)
    return game_run(learner, zeta0, duration, 0.01, disturbed=disturbed)


def levels(run: GameRun) -> Array:
    value = 0.5 * run.zeta[:, 0] ** 2 + run.zeta[:, 1] ** 2
    return lyapunov(value, run.errors(TWO_STATE_WEIGHTS))


@pytest.mark.parametrize("disturbed", [True, False])
def test_z_converges_from_the_level(disturbed: bool) -> None:
    """(24)-(26) hold, ε = 0: V_L falls at every step to nothing, although the printed K is 1e3."""
    start, zeta0 = TWO_STATE_WEIGHTS + np.array([0.01, -0.015, 0.01]), np.array([0.02, -0.02])
    run = learned(start, zeta0, GAINS, disturbed=disturbed, duration=8.0)
    V_L, Z = levels(run), distance(run.zeta, run.errors(TWO_STATE_WEIGHTS))
    smallest = min(margin(step.actor_1, step.actor_2) for step in run.steps[::20])
    assert smallest > (GAINS.actor_1 + GAINS.actor_2) / (2.0 * GAINS.critic), "(25) with ε' = 0"
    functions = two_state()[2]
    assert V_L[0] < exact_bound(functions, level_points(), SAMPLES, GAINS, 0.75 * smallest).level
    assert np.all(np.diff(V_L) < 0.0)
    assert V_L[-1] < 1e-7 * V_L[0]
    found = measure(functions, knowledge(TWO_STATE_WEIGHTS, disc(0.8, 400)), SAMPLES)
    assert found.epsilon_prime < 1e-12
    ball = np.linalg.norm(TWO_STATE_WEIGHTS) * (1.0 + 1.1 * 3.0)
    assert constants(found, GAINS, smallest, float(ball)).radius > 1e6 * Z[-1]


@pytest.mark.parametrize("start", FAR)
def test_v_l_falls_from_far_outside_the_level_too(start: Array) -> None:
    run = learned(start, np.array([0.7, -0.7]), GAINS, disturbed=True, duration=4.0)
    V_L = levels(run)
    assert V_L[0] > 100.0 * 2e-3
    assert np.all(np.diff(V_L) < 0.0)
    assert V_L[-1] < 1e-3 * V_L[0]


class Watched(LeastSquares):
    """Least squares that keeps Γ^-1 of before every step."""

    def __init__(self, settings: LearnerSettings) -> None:
        super().__init__(3, settings.forgetting, settings.covariance, settings.covariance_bound)
        self.before: list[Array] = []

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        self.before.append(self.information)
        return super().step(critic, rows, dt)


@pytest.mark.parametrize("start", FAR)
def test_v_l_of_least_squares_falls(start: Array) -> None:
    """V + W̃_c'Γ^-1 W̃_c/2 + ... along the run of least squares with forgetting."""
    problem, basis, functions = two_state()
    settings = plain(gain_actor_1=1.0, gain_actor_2=0.8, forgetting=1.0, covariance=10.0)
    law = Watched(settings)
    learner = Learner(
        problem, basis, settings, SAMPLES, TWO_STATE_WEIGHTS, start, functions, critic=law
    )
    run = game_run(learner, np.array([0.7, -0.7]), 4.0, 0.01)
    errors, value = run.errors(TWO_STATE_WEIGHTS), 0.5 * run.zeta[:, 0] ** 2 + run.zeta[:, 1] ** 2
    information = np.array(law.before)
    V_L = lyapunov(value, errors, information)
    by_hand = [e @ known @ e for e, known in zip(errors[0], information, strict=True)]
    rest = np.sum(errors[1] ** 2 + errors[2] ** 2, axis=1)
    np.testing.assert_allclose(V_L, value + 0.5 * (np.array(by_hand) + rest))
    assert np.linalg.eigvalsh(information[0])[0] == pytest.approx(0.1)
    assert np.linalg.eigvalsh(information[-1])[0] > 1.0
    assert np.all(np.diff(V_L) < 0.0)
    assert V_L[-1] < 1e-2 * V_L[0]


def test_v_l_rises_where_the_actors_are_too_fast() -> None:
    """Actors half way between W and a critic that errs where (18) is weakest: V_L_dot > 0 at first.

    Λ's weakest direction v, W̃_c = s v and W̃_ai = W̃_c/2 give -η_c λ s^2 + (η_a1 + η_a2) s^2/4 > 0.
    """
    omega = np.array([bellman(p, np.zeros(3), *[TWO_STATE_WEIGHTS] * 2)[0] for p in SAMPLES])
    normalized = omega.T @ (omega / np.sqrt(1.0 + np.sum(omega**2, axis=1))[:, None])
    eigenvalues, vectors = np.linalg.eigh(normalized)
    fast = Gains(1.0, 8.0 * float(eigenvalues[0]), 8.0 * float(eigenvalues[0]))
    error = 0.01 * vectors[:, 0]
    W = TWO_STATE_WEIGHTS
    state = np.concatenate([1e-4 * np.ones(2), W - error, W - error / 2, W - error / 2])
    rates = flow(state, fast)
    rise = -(error @ rates[2:5] + error / 2 @ (rates[5:8] + rates[8:]))
    assert rise > 0.5 * (0.25 * 16.0 - 1.0) * eigenvalues[0] * error @ error
    slow = Gains(1.0, 0.5 * float(eigenvalues[0]), 0.5 * float(eigenvalues[0]))
    rates = flow(state, slow)
    assert -(error @ rates[2:5] + error / 2 @ (rates[5:8] + rates[8:])) < 0.0


def test_the_run_is_the_flow_of_19_to_21() -> None:
    start, zeta0, span = FAR[1], np.array([0.5, -0.5]), 2.0
    run = learned(start, zeta0, GAINS, disturbed=True, duration=span)
    exact = solve_ivp(
        lambda t, z: flow(z, GAINS),
        (0.0, span),
        np.concatenate([zeta0, start, start, start]),
        rtol=1e-6,
        atol=1e-9,
    )
    reached = [run.zeta[-1], run.steps[-1].critic, run.steps[-1].actor_1, run.steps[-1].actor_2]
    # steps of 0.01 s with what the laws read held over them: first order
    np.testing.assert_allclose(np.concatenate(reached), exact.y[:, -1], atol=0.01)
    half = 0.5 * np.array([1.0, 2.0]) @ exact.y[:2] ** 2
    errors = [TWO_STATE_WEIGHTS[:, None] - exact.y[i : i + 3] for i in (2, 5, 8)]
    V_L = half + 0.5 * sum(np.sum(error**2, axis=0) for error in errors)
    assert np.all(np.diff(V_L) < 0.0)
