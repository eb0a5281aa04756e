"""Costate rows, moving samples and the safeguard: never worse than where they started."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from stationkeep.online import Learner, LearnerSettings, SampleSettings, draw_samples
from stationkeep.online.learning.safeguard import Safeguard
from stationkeep.online.rows import FixedSamples, ShrinkingSamples, TrajectorySamples
from stationkeep.symbolic import Path

from .games import TWO_STATE_WEIGHTS, Array, two_state

START = np.array([0.9, 0.3, 1.5])
COSTATE = LearnerSettings(
    error="costate", safeguard=True, steps=400, gain_actor_1=20.0, gain_actor_2=20.0, leash=1e-6
)


def learner(settings: LearnerSettings, start: Array = START) -> Learner:
    problem, basis, functions = two_state()
    samples = draw_samples(problem.scale, 30, 0)
    return Learner(problem, basis, settings, samples, start, start, functions, SampleSettings())


def test_costate_rows_find_the_exact_weights() -> None:
    """On the two-state game, where V* = ζ_1^2 / 2 + ζ_2^2, from a policy that is far from optimal."""
    taught = learner(COSTATE)
    zeta = np.array([0.8, -1.0])
    for _ in range(30):
        taught.step(zeta, 0.25)
    np.testing.assert_allclose(taught.critic, TWO_STATE_WEIGHTS, atol=2e-3)
    assert taught.predicted_cost(zeta, taught.actor_1, taught.actor_2) == pytest.approx(
        zeta[0] ** 2 / 2 + zeta[1] ** 2, rel=1e-4
    )


@pytest.mark.parametrize("rule", ["gradient", "least_squares"])
def test_predicted_cost_never_rises(rule: str) -> None:
    taught = learner(COSTATE.model_copy(update={"rule": rule}))
    zeta = np.array([-1.0, 1.2])
    costs = [taught.step(zeta, 0.25).predicted_cost for _ in range(15)]
    assert np.all(np.diff(costs) <= 1e-12)
    assert costs[-1] < 0.999 * costs[0]


def test_costate_learning_is_deterministic() -> None:
    first, second = learner(COSTATE), learner(COSTATE)
    for _ in range(3):
        for taught in (first, second):
            taught.step(np.array([0.5, 0.5]), 0.25)
    np.testing.assert_array_equal(first.critic, second.critic)


def test_at_the_origin_nothing_moves() -> None:
    taught = learner(COSTATE.model_copy(update={"leash": 0.0}))
    seen = taught.step(np.zeros(2), 0.25)
    assert np.all(np.isfinite(taught.critic))
    assert seen.accepted == 0.0
    np.testing.assert_array_equal(taught.actor_1, START)


def cost_of(zeta: Array, actor_1: Array, actor_2: Array) -> float:
    """Return a cost that is least at actors (1, 1) and infinite from 3 on."""
    distance = float(np.sum((actor_1 - 1.0) ** 2 + (actor_2 - 1.0) ** 2))
    return np.inf if max(actor_1.max(), actor_2.max()) >= 3.0 else distance


def pair(value: float) -> tuple[Array, Array]:
    return np.full(2, value), np.full(2, value)


@pytest.mark.parametrize(
    ("present", "proposed", "accepted"),
    [(0.0, 1.0, 1.0), (0.0, 1.9, 1.0), (0.0, 2.5, 0.5), (0.0, 7.0, 0.25), (0.0, 15.0, 0.1)],
)
def test_actors_go_as_far_as_is_certified(present: float, proposed: float, accepted: float) -> None:
    guard = Safeguard(cost_of, np.zeros(2))
    start = pair(present)
    before = cost_of(np.zeros(2), *start)
    moved, part, cost = guard.accepted(np.zeros(2), start, pair(proposed), before)
    assert part == accepted
    assert cost == cost_of(np.zeros(2), *moved) < before
    np.testing.assert_allclose(moved[0], present + part * (proposed - present))


@pytest.mark.parametrize("proposed", [-1.0, 30.0, np.nan])
def test_actors_stay_when_nothing_is_certified(proposed: float) -> None:
    guard = Safeguard(cost_of, np.zeros(2))
    start = pair(0.0)
    moved, part, cost = guard.accepted(np.zeros(2), start, pair(proposed), 4.0)
    assert (part, cost) == (0.0, 4.0)
    assert moved is start


def test_worse_than_linear_restarts_from_linear() -> None:
    guard = Safeguard(cost_of, np.full(2, 0.5))
    zeta = np.zeros(2)
    for value, expected in ((-1.0, True), (5.0, True), (0.9, False), (0.5, False)):
        actors, cost, fell_back = guard.certified(zeta, pair(value))
        assert fell_back is expected
        np.testing.assert_array_equal(actors[0], 0.5 if expected else value)
        assert cost == cost_of(zeta, *actors)


def test_a_learner_that_starts_worse_than_linear_falls_back() -> None:
    problem, basis, functions = two_state()
    wild = np.array([0.5, 0.0, 9.0])
    settings = COSTATE.model_copy(update={"error": "bellman"})
    taught = Learner(problem, basis, settings, np.zeros((0, 2)), TWO_STATE_WEIGHTS, wild, functions)
    seen = taught.step(np.array([0.5, 0.5]), 1e-9)
    assert seen.fallback
    np.testing.assert_allclose(taught.actor_1, TWO_STATE_WEIGHTS)


def test_the_linear_policy_is_used_where_no_weights_are_certified() -> None:
    """Actors and reference lose the vehicle; K_1 and K_2 come from scipy's Riccati equation."""
    problem = two_state()[0]
    wild, zeta = np.array([0.0, 0.0, -9.0]), np.array([0.5, 0.5])
    taught = learner(COSTATE.model_copy(update={"error": "bellman"}), wild)
    assert not np.isfinite(taught.predicted_cost(zeta, wild, wild))
    seen = taught.step(zeta, 1e-9)
    assert seen.fallback
    assert seen.linear
    A, B = problem.linearization
    P = scipy.linalg.solve_continuous_are(A, B, problem.game.Q, problem.game.R_eff)
    u_1, u_2 = taught.policies(zeta)
    np.testing.assert_allclose(u_1, -B.T @ P @ zeta, rtol=1e-8)  # R = 1
    np.testing.assert_allclose(u_2, B.T @ P @ zeta / 4.0, rtol=1e-8)  # γ = 2, W_d = 1


def test_the_linear_policy_gives_way_to_learned_weights() -> None:
    """Near the end of learning the weights are exact, and no other policy costs less."""
    taught = learner(COSTATE, 3.0 * TWO_STATE_WEIGHTS)
    zeta = np.array([1.5, -1.5])
    linear = [taught.step(zeta, dt).linear for dt in (1e-3, *[0.25] * 20)]
    assert linear[0]
    assert not linear[-1]


def straight(length: float = 10.0) -> Path:
    times = np.linspace(0.0, length, 101)
    states = np.exp(-times)[:, None] * np.array([1.0, 0.5])
    return Path(times, states, np.exp(-times))


def test_fixed_samples_stay() -> None:
    points = draw_samples(np.ones(2), 5, 0)
    assert FixedSamples(points).moved(np.ones(2), straight) is None
    np.testing.assert_array_equal(FixedSamples(points).first(), points)


@pytest.mark.parametrize(("size", "reach"), [(0.2, 0.3), (0.9, 1.0), (0.0, 1.5e-3)])
def test_shrinking_samples_scale_with_the_state(size: float, reach: float) -> None:
    half_widths = np.array([2.0, 0.4])
    unit = draw_samples(half_widths, 2000, 0)
    moved = ShrinkingSamples(unit, half_widths, 0.5).moved(half_widths * [size, 0.0], straight)
    assert moved is not None
    np.testing.assert_allclose(moved, reach * unit, rtol=1e-12)


def test_trajectory_samples_surround_the_path() -> None:
    half_widths = np.ones(2)
    strategy = TrajectorySamples(half_widths, 3000, 4, spread=0.5, ahead=2.0)
    points = strategy.moved(np.array([1.0, 0.5]), straight)
    assert points is not None
    states = straight().states[straight().times <= 2.0 + 1e-9]
    gaps = np.abs(points[:, None, :] - states) / (0.5 * states[:, :1])[None, :, :]
    assert np.all(gaps.max(axis=2).min(axis=1) <= 1.0 + 1e-12)
    assert points[:, 0].min() < 0.2
    assert points[:, 0].max() > 1.3
    again = TrajectorySamples(half_widths, 3000, 4, spread=0.5, ahead=2.0)
    np.testing.assert_array_equal(again.moved(np.array([1.0, 0.5]), straight), points)
    assert not np.any(strategy.moved(np.array([1.0, 0.5]), straight) == points)


def test_trajectory_samples_stay_near_a_state_that_is_lost() -> None:
    lost = Path(straight().times, straight().states, np.full(101, np.inf))
    strategy = TrajectorySamples(np.ones(2), 500, 4, spread=0.2, ahead=5.0)
    points = strategy.moved(np.array([0.6, -0.2]), lambda: lost)
    assert points is not None
    assert np.abs(points - [0.6, -0.2]).max() <= 0.2 * 0.6


@pytest.mark.parametrize("strategy", ["shrinking", "trajectory"])
def test_moving_samples_teach_the_exact_weights(strategy: str) -> None:
    problem, basis, functions = two_state()
    moving = (
        TrajectorySamples(problem.scale, 60, 0, spread=0.5, ahead=4.0)
        if strategy == "trajectory"
        else ShrinkingSamples(draw_samples(problem.scale, 60, 0), problem.scale, 0.5)
    )
    settings = LearnerSettings(normalizer="state_cost", steps=100)
    taught = Learner(problem, basis, settings, moving, TWO_STATE_WEIGHTS, START, functions)
    for _ in range(60):
        taught.step(np.array([0.9, -0.7]), 0.25)
    np.testing.assert_allclose(taught.critic, TWO_STATE_WEIGHTS, atol=1e-6)
