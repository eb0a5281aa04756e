"""Actor laws (20)(21) and the smooth projection: bounded weights, and never away from ideal ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp
from stationkeep.online.laws import actor_step
from stationkeep.online.paper import Projection

from .games import Array

M = 5
BALL = Projection(bound=2.0, margin=0.3)
OUTER = BALL.bound + BALL.margin

vectors = arrays(np.float64, M, elements=st.floats(-100.0, 100.0))
directions = vectors.filter(lambda a: float(np.linalg.norm(a)) > 1e-3)


def on_sphere(direction: Array, radius: float) -> Array:
    return direction * (radius / np.linalg.norm(direction))


@given(direction=directions, radius=st.floats(0.0, 1.0), mu=vectors)
def test_nothing_changes_inside_the_ball(direction: Array, radius: float, mu: Array) -> None:
    theta = on_sphere(direction, radius * BALL.bound * (1.0 - 1e-12))
    np.testing.assert_array_equal(BALL(theta, mu), mu)
    assert not BALL.active(theta)


@given(direction=directions, mu=vectors)
def test_weights_on_the_outer_sphere_do_not_leave(direction: Array, mu: Array) -> None:
    theta = on_sphere(direction, OUTER)
    assert theta @ BALL(theta, mu) <= 1e-12 * OUTER * np.linalg.norm(mu)
    assert BALL.active(theta)


@given(direction=directions, layer=st.floats(0.0, 1.0), mu=vectors, ideal=vectors)
def test_projection_never_leads_away_from_weights_inside(
    direction: Array, layer: float, mu: Array, ideal: Array
) -> None:
    """With W̃ = W* - Ŵ_a: W̃'(μ - proj(μ)) <= 0, so the Lyapunov derivative only gets smaller."""
    theta = on_sphere(direction, BALL.bound + layer * BALL.margin)
    W = ideal if np.linalg.norm(ideal) <= BALL.bound else on_sphere(ideal, BALL.bound)
    removed = mu - BALL(theta, mu)
    size = np.linalg.norm(W - theta) * np.linalg.norm(removed)
    assert (W - theta) @ removed <= 1e-12 * max(float(size), 1.0)


@given(direction=directions, layer=st.floats(0.05, 1.0), mu=vectors)
def test_only_the_outward_part_is_reduced(direction: Array, layer: float, mu: Array) -> None:
    theta = on_sphere(direction, BALL.bound + layer * BALL.margin)
    outward = theta / np.linalg.norm(theta)
    removed = mu - BALL(theta, mu)
    assert removed @ outward >= 0.0
    tangential = removed - (removed @ outward) * outward
    assert np.linalg.norm(tangential) <= 1e-12 * max(float(np.linalg.norm(removed)), 1.0)
    inward = mu - (mu @ outward) * outward - 10.0 * outward
    # the smoothing leaves at most s / |θ| of an inward rate to be removed
    assert np.linalg.norm(inward - BALL(theta, inward)) < BALL.smoothing


def jacobian(theta: Array, mu: Array, step: float) -> Array:
    """Return ∂proj/∂θ along the outward direction by a one-sided difference of signed step."""
    outward = theta / np.linalg.norm(theta)
    return (BALL(theta + step * outward, mu) - BALL(theta, mu)) / step


@pytest.mark.parametrize("seed", range(5))
def test_projection_is_continuously_differentiable_across_its_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta, mu = on_sphere(rng.standard_normal(M), BALL.bound), rng.standard_normal(M)
    h = 1e-6
    np.testing.assert_allclose(jacobian(theta, mu, h), jacobian(theta, mu, -h), atol=1e-4)
    just_outside = theta * (1.0 + 1e-5)
    np.testing.assert_allclose(jacobian(just_outside, mu, h), 0.0, atol=1e-2)
    # and not zero further out, so that the comparison can fail
    assert np.linalg.norm(jacobian(on_sphere(theta, 2.1), 10.0 * theta, h)) > 0.1


@pytest.mark.parametrize("seed", range(5))
def test_projection_is_smooth_where_the_rate_turns_inward(seed: int) -> None:
    """Across θ'μ = 0, where the usual projection has a kink."""
    rng = np.random.default_rng(seed)
    theta = on_sphere(rng.standard_normal(M), OUTER)
    outward = theta / np.linalg.norm(theta)
    tangent = rng.standard_normal(M)
    tangent -= (tangent @ outward) * outward
    h = 1e-7
    centre = BALL(theta, tangent)
    ahead = (BALL(theta, tangent + h * outward) - centre) / h
    behind = (centre - BALL(theta, tangent - h * outward)) / h
    np.testing.assert_allclose(ahead, behind, atol=1e-3)


def test_projection_is_the_published_formula() -> None:
    """Cai, de Queiroz and Dawson 2006, n = 1: written out at one point of the layer."""
    theta, mu = np.array([2.1, 0.2, 0.0, 0.3, 0.0]), np.array([1.0, -2.0, 0.5, 0.0, 3.0])
    p = theta @ theta - 4.0
    grad = 2.0 * theta
    eta_1 = p**2
    eta_2 = 0.5 * grad @ mu + np.sqrt((0.5 * grad @ mu) ** 2 + BALL.smoothing**2)
    denominator = 4.0 * (0.3**2 + 2.0 * 0.3 * 2.0) ** 2 * 2.0**2
    expected = mu - eta_1 * eta_2 / denominator * grad
    np.testing.assert_allclose(BALL(theta, mu), expected, rtol=1e-13)


@given(
    direction=directions,
    radius=st.floats(0.0, 1.0),
    critic=vectors,
    gain=st.floats(1e-3, 1e4),
    dt=st.floats(1e-6, 1e4),
)
def test_actors_never_leave_the_outer_ball(
    direction: Array, radius: float, critic: Array, gain: float, dt: float
) -> None:
    actor = on_sphere(direction, radius * OUTER)
    for _ in range(3):
        actor = actor_step(actor, critic, gain, dt, BALL)
        assert np.linalg.norm(actor) <= OUTER * (1.0 + 1e-12)


@given(
    direction=directions,
    radius=st.floats(0.0, 0.99),
    target=directions,
    gain=st.floats(1e-2, 1e2),
    dt=st.floats(1e-4, 1e2),
)
def test_inside_the_ball_the_law_is_solved_exactly(
    direction: Array, radius: float, target: Array, gain: float, dt: float
) -> None:
    """Ŵ_a(dt) = Ŵ_c + e^{-η_a dt} (Ŵ_a(0) - Ŵ_c) for a frozen critic."""
    actor = on_sphere(direction, radius * BALL.bound)
    critic = target if np.linalg.norm(target) <= BALL.bound else on_sphere(target, BALL.bound)
    assume(np.linalg.norm(actor) <= BALL.bound)
    answer = actor_step(actor, critic, gain, dt, BALL)
    expected = critic + np.exp(-gain * dt) * (actor - critic)
    np.testing.assert_allclose(answer, expected, rtol=1e-12, atol=1e-12)


def test_in_the_layer_short_steps_follow_the_projected_law() -> None:
    """Against scipy's solution of Ŵ_a_dot = proj{-η_a (Ŵ_a - Ŵ_c)} with the critic outside."""
    critic, actor = np.array([4.0, 1.0, 0.0, 0.0, 0.0]), np.array([1.9, 0.0, 0.5, 0.0, 0.0])
    gain, horizon, n = 2.0, 1.5, 3000
    reference = solve_ivp(
        lambda t, W: BALL(W, -gain * (W - critic)),
        (0.0, horizon),
        actor,
        "DOP853",
        rtol=1e-9,
        atol=1e-10,
    ).y[:, -1]
    for _ in range(n):
        actor = actor_step(actor, critic, gain, horizon / n, BALL)
    assert np.linalg.norm(reference) > BALL.bound
    np.testing.assert_allclose(actor, reference, atol=2e-3)


@given(direction=directions, critic=vectors, ideal=directions, gain=st.floats(0.1, 100.0))
def test_projected_step_comes_no_further_from_weights_inside(
    direction: Array, critic: Array, ideal: Array, gain: float
) -> None:
    """What the projection and the pull to the ball take away never separates Ŵ_a from W*."""
    actor = on_sphere(direction, OUTER)
    W = ideal if np.linalg.norm(ideal) <= BALL.bound else on_sphere(ideal, BALL.bound)
    dt = 1e-3 / gain
    free = critic + np.exp(-gain * dt) * (actor - critic)
    projected = actor_step(actor, critic, gain, dt, BALL)
    # the removed part is orthogonal to the sphere, so only its square can bring W* further away
    slack = 2.0 * float(np.sum((free - actor) ** 2)) + 1e-12
    assert np.sum((projected - W) ** 2) <= np.sum((free - W) ** 2) + slack
