"""States, currents, games and problems that can't be used: one sentence each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from stationkeep.symbolic import (
    Game,
    GammaTooSmallError,
    InputError,
    Model,
    Problem,
    Vehicle,
    two_state_game,
)
from stationkeep.symbolic.underwater import dynamics

Check = Callable[[BaseException], str]
WEIGHTS: dict[str, Any] = {"Q": np.eye(12), "R": np.eye(6), "W_d": np.eye(6), "gamma": 2.0}


@pytest.fixture(scope="module")
def model() -> Model:
    """The default vehicle; nothing here is worth compiling."""
    return Model(Vehicle.load("bluerov2-heavy"), compiled=False)


def indefinite(n: int) -> Any:
    """Return a symmetric matrix with the eigenvalue -0.25."""
    return np.diag([1.0] * (n - 1) + [-0.25])


@pytest.mark.parametrize("key", ["Q", "R", "W_d"])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (indefinite, ["positive definite", "-0.25"]),
        (lambda n: np.zeros(n), ["positive definite", "0"]),
        (lambda n: np.eye(n) + np.eye(n, k=1), ["symmetric"]),
        (lambda n: np.ones((n, n - 1)), ["shape", "square"]),
        (lambda n: np.ones((2, n, n)), ["shape", "square"]),
        (lambda n: 1.0, ["shape", "square"]),
        (lambda n: np.full(n, np.nan), ["not finite"]),
        (lambda n: np.full(n, np.inf), ["not finite"]),
        (lambda n: "heavy", ["numbers"]),
        (lambda n: [[1.0, 2.0], [3.0]], ["numbers"]),
        (lambda n: [], []),
    ],
    ids=[
        "indefinite",
        "zero",
        "unsymmetric",
        "rectangle",
        "three-dimensional",
        "scalar",
        "nan",
        "inf",
        "text",
        "ragged",
        "empty",
    ],
)
def test_weights(key: str, change: Callable[[int], Any], words: list[str], one_sentence: Check) -> None:
    """Each weight must be a finite symmetric positive definite matrix (or a diagonal)."""
    n = 12 if key == "Q" else 6
    with pytest.raises(InputError) as caught:
        Game(**WEIGHTS | {key: change(n)})
    text = one_sentence(caught.value)
    assert text.startswith(f"{key} ")
    assert all(word in text for word in words), text


def test_weights_of_the_two_players_must_agree(one_sentence: Check) -> None:
    """They push through the same g."""
    with pytest.raises(InputError, match="same shape") as caught:
        Game(**WEIGHTS | {"W_d": np.eye(5)})
    assert "(6, 6)" in one_sentence(caught.value)
    assert "(5, 5)" in str(caught.value)


@pytest.mark.parametrize("gamma", [0.0, -1.0, np.nan, -np.inf])
def test_gamma_must_be_positive(gamma: float, one_sentence: Check) -> None:
    """Not zero, negative or undefined."""
    with pytest.raises(InputError, match="positive number") as caught:
        Game(**WEIGHTS | {"gamma": gamma})
    assert not isinstance(caught.value, GammaTooSmallError)
    assert f"gamma is {gamma}" in one_sentence(caught.value)


@pytest.mark.parametrize(("R", "gamma"), [(1.0, 0.0), (-1.0, 2.0), (1.0, 1.0), (4.0, 1.9)])
def test_closed_form_game_obeys_the_same_rules(R: float, gamma: float, one_sentence: Check) -> None:
    """R > 0 and gamma^2 > R > 0."""
    with pytest.raises(InputError) as caught:
        two_state_game(R, gamma)
    one_sentence(caught.value)


@pytest.mark.parametrize("function", ["drift", "input_matrix"])
@pytest.mark.parametrize(
    ("state", "words"),
    [
        (np.zeros(11), ["12 numbers", "(11,)"]),
        (np.zeros((12, 1)), ["12 numbers", "(12, 1)"]),
        (0.0, ["12 numbers"]),
        ("level", ["12 numbers"]),
        ([[1.0], [1.0, 2.0]], ["12 numbers"]),
        ([np.nan] + [0.0] * 11, ["finite", "NaN"]),
        ([0.0] * 11 + [np.inf], ["finite", "infinity"]),
        ([0.0] * 4 + [np.pi / 2] + [0.0] * 7, ["pitch is 90.0 deg", "±90 deg"]),
        ([0.0] * 4 + [-2.0] + [0.0] * 7, ["pitch is -114.6 deg", "±90 deg"]),
    ],
)
def test_states(function: str, state: Any, words: list[str], model: Model, one_sentence: Check) -> None:
    """Twelve finite numbers with the pitch inside ±90 degrees."""
    with pytest.raises(InputError) as caught:
        getattr(model, function)(state)
    text = one_sentence(caught.value)
    assert all(word in text for word in words), text


def test_states_that_are_allowed(model: Model) -> None:
    """A pitch of 89.9 degrees, any roll and yaw; lists; two states of a game that is no vehicle."""
    assert np.isfinite(model.drift([0, 0, 0, 9.0, np.radians(89.9), -9.0, 0, 0, 0, 0, 0, 0])).all()
    game = two_state_game()
    assert game.require_state([1, 2]).tolist() == [1.0, 2.0]
    with pytest.raises(InputError, match=r"2 numbers \(x_1,x_2\), but its shape is \(3,\)"):
        game.require_state([1, 2, 3])


@pytest.mark.parametrize("current", [(1.0, 2.0), (np.nan, 0.0, 0.0), (0.0, np.inf, 0.0), 0.5, "fast"])
def test_currents(current: Any, one_sentence: Check) -> None:
    """Three finite numbers; a speed alone has no direction."""
    with pytest.raises(InputError, match="three finite numbers in m/s") as caught:
        Model(Vehicle.load("bluerov2-heavy"), current=current, compiled=False)
    assert str(current) in one_sentence(caught.value)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_scale_must_be_positive(
    value: float, model: Model, reference_game: Game, one_sentence: Check
) -> None:
    """The unit of the scaled state: finite and positive."""
    scale = np.ones(12)
    scale[3] = value
    with pytest.raises(InputError, match="12 positive") as caught:
        model.problem(reference_game, scale)
    assert "half-widths" in one_sentence(caught.value)
    with pytest.raises(InputError, match="12 positive"):
        model.problem(reference_game, np.ones(11))


@pytest.mark.parametrize(("n", "k"), [(11, 6), (12, 5)])
def test_game_must_fit_the_plant(n: int, k: int, model: Model, one_sentence: Check) -> None:
    """Q for the 12 states, R and W_d for the 6 inputs."""
    with pytest.raises(InputError) as caught:
        model.problem(Game(np.eye(n), np.eye(k), np.eye(k), 2.0), np.ones(12))
    text = one_sentence(caught.value)
    words = [f"Q has {n} rows", f"R has {k}", "12 states and 6 inputs"]
    assert all(word in text for word in words), text


def test_drift_must_vanish_at_the_station(reference_game: Game, one_sentence: Check) -> None:
    """A vehicle that is too light rises: the trim has to be taken out, and `Model.problem` does it."""
    model = Model(Vehicle.load("rexrov"), compiled=False)
    problem = model.problem(reference_game, np.ones(12))
    f = dynamics.drift(model.vehicle, problem.zeta)
    with pytest.raises(InputError, match=r"f\(0\) must be 0") as caught:
        Problem("rexrov", problem.zeta, f, problem.input_matrix, reference_game, np.ones(12))
    assert "trim" in one_sentence(caught.value)
