"""A learning step that would leave what is not finite is not taken: weights and information stay."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from stationkeep.online import LearnedPolicy, Learner, LearnerSettings, LearnerStep, SampleSettings
from stationkeep.online.laws import Equations, LeastSquares, NormalEquations
from stationkeep.online.learning.memory import EVERY, EnvelopeMemory
from stationkeep.online.rows import PathRows
from stationkeep.symbolic import InputError, Setup

from .games import TWO_STATE_WEIGHTS, Array, plain, two_state

STATE = np.array([0.6, -0.4])
POINTS = np.random.default_rng(3).uniform(-1.0, 1.0, (40, 2))
BAD = [np.nan, np.inf, -np.inf, 1e300]


class Broken:
    """A law that returns one given number in every weight, and remembers that it was asked."""

    def __init__(self) -> None:
        self.gives: float | None = None
        self.information = np.eye(3)

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        self.information = 2.0 * self.information
        return critic + 0.01 if self.gives is None else np.full(3, self.gives)


def learner(settings: LearnerSettings, law: Broken | None = None) -> Learner:
    """Return a learner of the two-state game, from other weights than W*."""
    problem, basis, functions = two_state()
    start = 1.3 * TWO_STATE_WEIGHTS + np.array([0.0, 0.1, 0.0])
    return Learner(problem, basis, settings, POINTS, start, functions=functions, critic=law)


def weights(one: Learner) -> Array:
    return np.concatenate([one.critic, one.actor_1, one.actor_2])


@pytest.mark.parametrize("gives", BAD)
def test_weights_that_are_not_finite_are_not_taken(gives: float) -> None:
    law = Broken()
    one = learner(plain(), law)
    assert not one.step(STATE, 0.25).rolled_back
    before, information = weights(one), law.information
    law.gives = gives
    seen = one.step(STATE, 0.25)
    assert seen.rolled_back
    np.testing.assert_array_equal(weights(one), before)
    assert law.information is information
    law.gives = None
    assert not one.step(STATE, 0.25).rolled_back


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("rule", ["gradient", "least_squares"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_rows_that_are_not_finite_teach_nothing(rule: str, value: float) -> None:
    """And the steps after it are those of a learner that never saw them."""
    one, other = (learner(plain(rule=rule)) for _ in range(2))
    for each in (one, other):
        each.step(STATE, 0.25)
    at = one.source.at

    def spoilt(*arguments: object) -> object:
        seen = at(*arguments)  # type: ignore[arg-type]
        matrix = np.array(seen.equations.matrix)
        matrix[0, 0] = value
        rows = NormalEquations(matrix, value * seen.equations.gradient, seen.equations.leash)
        return seen._replace(equations=rows)

    one.source.at = spoilt  # type: ignore[assignment,method-assign]
    before = weights(one)
    assert one.step(STATE, 0.25).rolled_back
    np.testing.assert_array_equal(weights(one), before)
    one.source.at = at  # type: ignore[method-assign]
    for each in (one, other):
        assert not each.step(0.9 * STATE, 0.25).rolled_back
    np.testing.assert_array_equal(weights(one), weights(other))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1e6])
def test_information_stays_where_a_step_is_refused(value: float) -> None:
    law, fresh = LeastSquares(3, 1.0, 1e3, 1e5), LeastSquares(3, 1.0, 1e3, 1e5)
    rows = NormalEquations(np.diag([1.0, 2.0, 3.0]), np.ones(3), np.zeros(3))
    spoilt = replace(rows, matrix=np.diag([1.0, value, 3.0]))
    with pytest.raises(np.linalg.LinAlgError, match="finite and positive definite"):
        law.step(np.zeros(3), spoilt, 0.1)
    np.testing.assert_array_equal(law.step(np.zeros(3), rows, 0.1), fresh.step(np.zeros(3), rows, 0.1))
    np.testing.assert_array_equal(law.information, fresh.information)


REFUSED: dict[str, Callable[[Learner], LearnerStep]] = {
    "NaN": lambda one: one.step(np.array([np.nan, 0.0]), 0.25),
    "infinity": lambda one: one.step(np.array([0.0, np.inf]), 0.25),
    "three states": lambda one: one.step(np.zeros(3), 0.25),
    "no state": lambda one: one.step(None, 0.25),  # type: ignore[arg-type]
    "no time": lambda one: one.step(STATE, 0.0),
    "backwards": lambda one: one.step(STATE, -1.0),
    "NaN time": lambda one: one.step(STATE, np.nan),
    "a word": lambda one: one.step(STATE, "0.25"),  # type: ignore[arg-type]
    "a list": lambda one: one.step(STATE, [0.25]),  # type: ignore[arg-type]
    "true": lambda one: one.step(STATE, True),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_state_or_time_is_refused(
    name: str, one_sentence: Callable[[BaseException], str]
) -> None:
    one = learner(plain())
    one.step(STATE, 0.25)
    before, information = weights(one), one.law.information  # type: ignore[attr-defined]
    with pytest.raises(InputError) as caught:
        REFUSED[name](one)
    one_sentence(caught.value)
    np.testing.assert_array_equal(weights(one), before)
    assert one.law.information is information  # type: ignore[attr-defined]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_to_start_from_are_finite(
    value: float, one_sentence: Callable[[BaseException], str]
) -> None:
    problem, basis, functions = two_state()
    start = np.array([0.5, value, 1.0])
    for reference, initial in ((start, None), (TWO_STATE_WEIGHTS, start)):
        with pytest.raises(InputError, match="contain NaN or infinity") as caught:
            Learner(problem, basis, plain(), POINTS, reference, initial, functions)
        one_sentence(caught.value)


def test_steps_that_are_not_taken_are_counted_and_told(caplog: pytest.LogCaptureFixture) -> None:
    law = Broken()
    one, law.gives = learner(plain(), law), np.nan
    with caplog.at_level(logging.WARNING, logger="stationkeep"):
        for _ in range(25):
            one.step(STATE, 0.25)
    assert one.rolled_back == 25
    assert [record.args for record in caplog.records] == [(1,), (10,)]


def learned_policy() -> LearnedPolicy:
    """Return the learner's policy of the two-state game."""
    problem, basis, _ = two_state()
    setup = Setup(problem=problem, basis=basis, envelope=np.ones(2), compiled=False)
    scenario = SimpleNamespace(
        learner=plain(),
        samples=SampleSettings(number=40),
        setup=lambda: setup,
        initial_weights=lambda: None,
        critic_law=lambda: None,
    )
    return LearnedPolicy(scenario)


@pytest.mark.parametrize(
    ("state", "dt"),
    [
        ([np.nan, 0.0], 0.02),
        ([0.0, -np.inf], 0.02),
        ([0.0], 0.02),
        ("ab", 0.02),
        (STATE, 0.0),
        (STATE, np.nan),
        (STATE, "0.02"),
        (STATE, None),
    ],
)
def test_a_policy_of_any_problem_refuses_and_changes_nothing(
    state: Any, dt: Any, one_sentence: Callable[[BaseException], str]
) -> None:
    one, twin = learned_policy(), learned_policy()
    for i in range(20):
        given = one.step(0.95**i * STATE, 0.05)
        with pytest.raises(InputError) as caught:
            one.step(state, dt)
        one_sentence(caught.value)
        np.testing.assert_array_equal(given, twin.step(0.95**i * STATE, 0.05))
        np.testing.assert_array_equal(one.zeta, twin.zeta)
    np.testing.assert_array_equal(weights(one.learner), weights(twin.learner))


class Rows(PathRows):
    """Rows of three weights, of which some steps give what is not finite."""

    def __init__(self, bad: set[int]) -> None:
        self.bad, self.calls, self.rng = bad, 0, np.random.default_rng(0)

    def at(self, starts: Array, actor_1: Array, actor_2: Array) -> tuple[Array, Array, Array]:
        self.calls += 1
        omega = self.rng.standard_normal((5, 3))
        if self.calls in self.bad:
            return np.full((5, 3), np.nan), np.full(5, np.inf), np.ones(5)
        return omega, omega @ TWO_STATE_WEIGHTS, np.ones(5)


class Distance:
    """A cost that is least at W*."""

    def cost(self, zeta: Array, actor_1: Array, actor_2: Array) -> float:
        return 1.0 + float(np.sum((actor_1 - TWO_STATE_WEIGHTS) ** 2))

    def linear_cost(self, zeta: Array) -> float:
        return 1.0


def test_a_path_that_is_not_finite_is_not_remembered() -> None:
    """The fit to the others still finds their weights."""
    rows = Rows(bad={3, 7, 20})
    memory = EnvelopeMemory(rows, Distance(), np.ones(2), np.zeros(3), seed=1)
    for _ in range(2 * EVERY):
        memory.step()
    np.testing.assert_allclose(memory.weights, TWO_STATE_WEIGHTS, atol=1e-3)
