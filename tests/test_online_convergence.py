"""The learner reaches weights that are known: two-state game, linear game, equal players."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from stationkeep.online import (
    Learner,
    LearnerSettings,
    SampleSettings,
    SimulationSettings,
    draw_samples,
    run,
)
from stationkeep.online.laws import Equations
from stationkeep.symbolic import StationKeeping, ValueFunctions

from .games import (
    HALF_WIDTHS,
    TWO_STATE_WEIGHTS,
    Array,
    linear_quadratic,
    plain,
    quick_scenario,
    random_weights,
    two_state,
)

ADMISSIBLE = (np.array([0.9, 0.3, 1.5]), np.array([0.4, -0.2, 0.8]), np.array([3.0, 1.0, 1.0]))


def two_state_learner(start: Array, settings: LearnerSettings) -> Learner:
    problem, basis, functions = two_state()
    samples = draw_samples(np.ones(2), 100, seed=0)
    return Learner(problem, basis, settings, samples, TWO_STATE_WEIGHTS, start, functions)


def distance(learner: Learner, exact: Array) -> float:
    """Return the largest relative distance of critic and actors to the exact weights."""
    weights = (learner.critic, learner.actor_1, learner.actor_2)
    return max(float(np.linalg.norm(w - exact) / np.linalg.norm(exact)) for w in weights)


@pytest.mark.parametrize("start", ADMISSIBLE)
def test_starting_weights_are_admissible_and_not_the_answer(start: Array) -> None:
    problem, _, _ = two_state()
    A, B = problem.linearization
    assert np.linalg.eigvals(A).real.max() > 1.0
    # the gradient of W_1 x_1^2 + W_2 x_1 x_2 + W_3 x_2^2 is [[2 W_1, W_2], [W_2, 2 W_3]] x
    gradient = np.array([[2.0 * start[0], start[1]], [start[1], 2.0 * start[2]]])
    v_gain = -0.5 * problem.game.R_eff_inverse @ B.T @ gradient
    assert np.linalg.eigvals(A + B @ v_gain).real.max() < -0.05
    assert np.linalg.norm(start - TWO_STATE_WEIGHTS) > 0.2


@pytest.mark.parametrize("start", ADMISSIBLE)
def test_printed_gradient_critic_finds_the_closed_form_weights(start: Array) -> None:
    """(19) as printed: one gain, no 1/N, p = sqrt(1 + ω'ω)."""
    settings = LearnerSettings.as_printed(gain_critic=1.0, gain_actor_1=1.0, gain_actor_2=1.0)
    assert settings.gain_samples is None
    learner = two_state_learner(start, settings)
    for i in range(400):
        learner.step(np.array([0.5, -0.5]) * np.exp(-0.05 * i), 0.05)
    assert distance(learner, TWO_STATE_WEIGHTS) < 1e-2


@pytest.mark.parametrize("start", ADMISSIBLE)
def test_least_squares_finds_the_closed_form_weights(start: Array) -> None:
    learner = two_state_learner(start, plain())
    for i in range(80):
        learner.step(np.array([0.5, -0.5]) * np.exp(-0.25 * i), 0.25)
    assert distance(learner, TWO_STATE_WEIGHTS) < 1e-6


@pytest.mark.parametrize("gains", [(1.0, 1.0), (3.0, 0.5)])
def test_each_actor_follows_the_critic_with_its_own_gain(gains: tuple[float, float]) -> None:
    settings = plain(gain_actor_1=gains[0], gain_actor_2=gains[1])
    learner = two_state_learner(ADMISSIBLE[0], settings)
    for i in range(150):
        learner.step(np.array([0.5, -0.5]) * np.exp(-0.25 * i), 0.25)
        if i == 0:
            same = np.array_equal(learner.actor_1, learner.actor_2)
            assert same == (gains[0] == gains[1])
    assert distance(learner, TWO_STATE_WEIGHTS) < 1e-6


class Newton:
    """A critic law of a user's own: the rows are solved at once, which is policy iteration."""

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        return critic - np.linalg.solve(rows.matrix, rows.gradient)


def test_any_critic_law_can_be_supplied() -> None:
    """Actors that follow within a step make it Newton's method on the HJI: digits double."""
    problem, basis, functions = two_state()
    settings = plain(gain_actor_1=1e3, gain_actor_2=1e3)
    samples = draw_samples(np.ones(2), 100, seed=0)
    learner = Learner(
        problem,
        basis,
        settings,
        samples,
        TWO_STATE_WEIGHTS,
        ADMISSIBLE[0],
        functions,
        critic=Newton(),
    )
    errors = []
    for _ in range(6):
        learner.step(np.array([0.5, -0.5]), 1.0)
        errors.append(float(np.linalg.norm(learner.critic - TWO_STATE_WEIGHTS)))
    assert errors[0] > 1e-3
    for before, after in pairwise(errors):
        assert after < max(2.0 * before**2, 1e-12)


def test_without_samples_a_state_at_rest_teaches_nothing() -> None:
    problem, basis, functions = two_state()
    settings = LearnerSettings.as_printed(gain_critic=100.0)
    nothing = np.empty((0, 2))
    learner = Learner(problem, basis, settings, nothing, TWO_STATE_WEIGHTS, ADMISSIBLE[0], functions)
    for _ in range(50):
        seen = learner.step(np.zeros(2), 0.1)
    assert np.isnan(seen.sample_error)
    assert len(learner.sample_residual()) == 0
    np.testing.assert_array_equal(learner.critic, ADMISSIBLE[0])


@pytest.mark.parametrize("normalizer", ["paper", "state_cost"])
def test_least_squares_finds_the_riccati_solution_from_half_of_it(normalizer: str) -> None:
    problem, basis, functions = linear_quadratic()
    exact = basis.quadratic_weights(problem.P)
    settings = plain(normalizer=normalizer, weight_factor=0.5)
    samples = draw_samples(HALF_WIDTHS, 300, seed=1)
    learner = Learner(problem, basis, settings, samples, exact, None, functions)
    assert distance(learner, exact) == pytest.approx(0.5)
    for _ in range(50):
        learner.step(np.zeros(12), 0.25)
    assert distance(learner, exact) < 1e-6
    zeta = 0.7 * HALF_WIDTHS
    assert learner.value(zeta) == pytest.approx(zeta @ problem.P @ zeta, rel=1e-7)
    u_control, u_disturbance = learner.policies(zeta)
    _, B = problem.linearization
    np.testing.assert_allclose(u_control, -problem.game.R_inverse @ B.T @ problem.P @ zeta, rtol=1e-5)
    np.testing.assert_allclose(u_disturbance, -u_control / problem.game.gamma**2, rtol=1e-5)


@cache
def single_player() -> StationKeeping:
    """The quick scenario's vehicle with one player and R_eff."""
    setup = quick_scenario().station_keeping()
    alone = replace(setup, problem=setup.problem.with_game(setup.game.single_player()))
    alone.__dict__["functions"] = ValueFunctions(alone.problem, setup.basis, compiled=False)
    return alone


def twins(settings: LearnerSettings, start: Array) -> list[Learner]:
    """Return the learner of the game, and of its single-player equivalent."""
    pair, alone = quick_scenario().station_keeping(), single_player()
    samples = draw_samples(pair.envelope, 200, seed=1)
    reference = pair.riccati_weights
    return [
        Learner(s.problem, s.basis, settings, samples, reference, start, s.functions)
        for s in (pair, alone)
    ]


@pytest.mark.parametrize("rule", ["gradient", "least_squares"])
@pytest.mark.parametrize("bound", [3.0, 1.001])
def test_equal_actors_stay_equal_and_are_one_player(rule: str, bound: float) -> None:
    setup = quick_scenario().station_keeping()
    settings = plain(rule=rule, normalizer="state_cost", leash=0.01, weight_bound=bound)
    start = setup.riccati_weights * (1.0 + 0.1 * random_weights(1, 78)[0])
    pair, alone = twins(settings, start)
    rng = np.random.default_rng(2)
    projected = 0
    for _ in range(25):
        zeta = setup.envelope * rng.uniform(-1.0, 1.0, 12)
        projected += pair.step(zeta, 0.25).projecting
        alone.step(zeta, 0.25)
        np.testing.assert_array_equal(pair.actor_1, pair.actor_2)
    assert (projected > 0) == (bound < 2.0)
    moved = float(np.linalg.norm(pair.critic - start) / np.linalg.norm(start))
    gap = float(np.linalg.norm(pair.critic - alone.critic) / np.linalg.norm(alone.critic))
    assert moved > 1e-3
    assert gap < 1e-9, gap
    np.testing.assert_allclose(pair.actor_1, alone.actor_1, atol=1e-9 * np.linalg.norm(start))


def test_unequal_gains_part_the_actors() -> None:
    setup = quick_scenario().station_keeping()
    settings = plain(gain_actor_1=2.0, gain_actor_2=1.0, normalizer="state_cost")
    learner = twins(settings, 1.1 * setup.riccati_weights)[0]
    learner.step(0.3 * setup.envelope, 0.25)
    assert not np.array_equal(learner.actor_1, learner.actor_2)


class SamePlant:
    """The quick scenario, shorter, on a given plant and game."""

    def __init__(self, setup: StationKeeping) -> None:
        quick = quick_scenario("simulation.duration=1.5", "learner.leash=0.05")
        self.learner: LearnerSettings = quick.learner
        self.samples: SampleSettings = quick.samples
        self.simulation: SimulationSettings = quick.simulation
        self._setup = setup

    @property
    def initial_state(self) -> Array:
        return np.array(self.simulation.initial_state)

    def setup(self) -> StationKeeping:
        return self._setup

    def station_keeping(self) -> StationKeeping:
        return self._setup

    def initial_weights(self) -> Array | None:
        return None

    def critic_law(self) -> None:
        return None

    def plant_vehicle(self) -> None:
        return None


def test_closed_loop_of_the_game_is_that_of_its_single_player() -> None:
    """The applied force û_1 + û_2 is v̂, and the game's cost is the single player's."""

    pair = run(SamePlant(quick_scenario().station_keeping()))
    single = run(SamePlant(single_player()))
    assert pair.stopped is None
    assert single.stopped is None
    for actor_1, actor_2 in zip(pair.actor_1, pair.actor_2, strict=True):
        np.testing.assert_array_equal(actor_1, actor_2)
    first, last = np.array(pair.critic[0]), np.array(pair.critic[-1])
    assert np.linalg.norm(last - first) > 1e-3 * np.linalg.norm(first)
    np.testing.assert_allclose(last, single.critic[-1], atol=1e-8 * np.linalg.norm(last))
    np.testing.assert_allclose(pair.zeta, single.zeta, atol=1e-9)
    cost = np.array(pair.cost) - np.array(pair.attenuated)
    np.testing.assert_allclose(cost, single.cost, atol=1e-8 * single.cost[-1])
    assert single.attenuated[-1] == 0.0
    assert pair.attenuated[-1] > 1.0
