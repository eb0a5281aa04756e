"""A problem as data: the very same problem comes back, and damaged data are one sentence."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
import pytest
from casadi import DM
from stationkeep.symbolic import InputError, Problem
from stationkeep.symbolic.game import problem_from_data, problem_to_data
from stationkeep.symbolic.textbook import double_integrators, quadrotor, two_state_game

from .games import quick_scenario

PROBLEMS: dict[str, Callable[[], Problem]] = {
    "vehicle": lambda: quick_scenario().setup().problem,
    "quadrotor": quadrotor,
    "integrators": lambda: double_integrators(3, stiffness=1.0),
    "two states": two_state_game,
}
Data = dict[str, Any]


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_same_problem_comes_back(name: str) -> None:
    then = PROBLEMS[name]()
    text = json.dumps(problem_to_data(then))
    now = problem_from_data(json.loads(text))
    assert json.dumps(problem_to_data(now)) == text
    rng = np.random.default_rng(0)
    for _ in range(5):
        zeta = 0.5 * then.scale * rng.uniform(-1, 1, then.n_states)
        for problem in (then, now):
            outputs = [problem.drift, problem.control_matrix, problem.switching, problem.margins]
            problem.__dict__["values"] = casadi.Function("f", [problem.zeta], outputs)(zeta)
        for a, b in zip(then.__dict__["values"], now.__dict__["values"], strict=True):
            np.testing.assert_array_equal(np.array(DM(a)), np.array(DM(b)))
    for field in ("name", "state_names", "state_units", "input_names", "input_units"):
        assert getattr(now, field) == getattr(then, field)
    np.testing.assert_array_equal(now.P, then.P)
    assert (now.inverse_dynamics is None) == (then.inverse_dynamics is None)
    assert [bound.sentence for bound in now.domain] == [bound.sentence for bound in then.domain]


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data.pop("equations"),
        lambda data: data.pop("game"),
        lambda data: data["game"].update(Q="many"),
        lambda data: data["game"].update(gamma="high"),
        lambda data: data.update(scale=[1.0]),
        lambda data: data.update(state_names=["only one"]),
        lambda data: data.update(domain=["a bound without equations"]),
        lambda data: data.update(equations={}),
        lambda data: data.update(equations=7),
    ],
)
def test_damaged_data_are_one_sentence(
    damage: Callable[[Data], object], one_sentence: Callable[[BaseException], str]
) -> None:
    data = problem_to_data(two_state_game())
    damage(data)
    with pytest.raises(InputError) as caught:
        problem_from_data(data)
    one_sentence(caught.value)
