"""Costate rows and the safeguard: never worse than where they started."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from stationkeep.online import Learner, LearnerSettings, SampleSettings, draw_samples
from stationkeep.online.learning.safeguard import Certified, Safeguard, Unguarded

from .games import TWO_STATE_WEIGHTS, Array, two_state

START = np.array([0.9, 0.3, 1.5])
COSTATE = LearnerSettings(steps=400, gain_actor_1=20.0, gain_actor_2=20.0, leash=1e-6)


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


class Bowl:
    """A cost that is least at actors (1, 1) and infinite from 3 on; the linear policy's is given."""

    def __init__(self, linear: float = np.inf) -> None:
        self.linear = linear

    def cost(self, zeta: Array, actor_1: Array, actor_2: Array) -> float:
        distance = float(np.sum((actor_1 - 1.0) ** 2 + (actor_2 - 1.0) ** 2))
        return np.inf if max(actor_1.max(), actor_2.max()) >= 3.0 else distance

    def linear_cost(self, zeta: Array) -> float:
        return self.linear


def pair(value: float) -> tuple[Array, Array]:
    return np.full(2, value), np.full(2, value)


@pytest.mark.parametrize(
    ("present", "proposed", "accepted"),
    [(0.0, 1.0, 1.0), (0.0, 1.9, 1.0), (0.0, 2.5, 0.5), (0.0, 7.0, 0.25), (0.0, 15.0, 0.1)],
)
def test_actors_go_as_far_as_is_certified(present: float, proposed: float, accepted: float) -> None:
    guard = Safeguard(Bowl(), np.zeros(2))
    start = Certified(pair(present), Bowl().cost(np.zeros(2), *pair(present)), restarted=False)
    moved, part, cost, linear = guard.accepted(np.zeros(2), start, pair(proposed))
    assert part == accepted
    assert cost == Bowl().cost(np.zeros(2), *moved) < start.cost
    assert not linear
    np.testing.assert_allclose(moved[0], present + part * (proposed - present))


@pytest.mark.parametrize("proposed", [-1.0, 30.0, np.nan])
def test_actors_stay_when_nothing_is_certified(proposed: float) -> None:
    guard = Safeguard(Bowl(), np.zeros(2))
    start = Certified(pair(0.0), 4.0, restarted=False)
    end = guard.accepted(np.zeros(2), start, pair(proposed))
    assert (end.part, end.cost) == (0.0, 4.0)
    assert end.actors is start.actors
    assert end == guard.kept(np.zeros(2), start)


def test_worse_than_linear_restarts_from_linear() -> None:
    guard = Safeguard(Bowl(), np.full(2, 0.5))
    zeta = np.zeros(2)
    for value, expected in ((-1.0, True), (5.0, True), (0.9, False), (0.5, False)):
        actors, cost, fell_back = guard.certified(zeta, pair(value))
        assert fell_back is expected
        np.testing.assert_array_equal(actors[0], 0.5 if expected else value)
        assert cost == Bowl().cost(zeta, *actors)


@pytest.mark.parametrize(("linear", "used"), [(1.0, False), (0.1, True)])
def test_the_linear_policy_is_used_where_it_costs_less_and_is_known(linear: float, used: bool) -> None:
    """From actors at 0, where the bowl is 4, to 3/4, where it is 1/4."""
    start = Certified(pair(0.0), 4.0, restarted=False)
    for known in (True, False):
        guard = Safeguard(Bowl(linear), np.zeros(2), may_use_linear=known)
        assert guard.accepted(np.zeros(2), start, pair(0.75)).linear is (used and known)
        assert guard.kept(np.zeros(2), start).linear is known


def test_without_a_safeguard_every_step_passes() -> None:
    guard, zeta = Unguarded(), np.zeros(2)
    start = guard.certified(zeta, pair(50.0))
    assert not start.restarted
    end = guard.accepted(zeta, start, pair(99.0))
    assert (end.part, end.linear) == (1.0, False)
    np.testing.assert_array_equal(end.actors, pair(99.0))
    np.testing.assert_array_equal(guard.kept(zeta, start).actors, pair(50.0))
    assert np.isnan([start.cost, end.cost]).all()


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
