"""What a disturbance observer refuses, and what it does not estimate from: it stays finite."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import numpy as np
import pytest
from stationkeep.online import Controller, DisturbanceObserver
from stationkeep.symbolic import InputError

from .games import Array, quick_scenario

FORCE = np.array([3.0, -2.0, 1.0, 0.2, -0.1, 0.3])
STEP = 0.02


def observer() -> DisturbanceObserver:
    return DisturbanceObserver(quick_scenario().station_keeping(), 1.0)


def moved(i: int) -> Array:
    """Return a state that moves on smoothly."""
    t = STEP * i
    return np.concatenate([0.1 * np.sin(t + np.arange(6.0)), 0.1 * np.cos(t + np.arange(6.0))])


def followed(one: DisturbanceObserver, steps: int, first: int = 0) -> Array:
    """Return the estimates along the motion."""
    found = []
    for i in range(first, first + steps):
        found.append(one.step(moved(i), STEP))
        one.applied(FORCE)
    return np.array(found)


WRONG: dict[str, Callable[[DisturbanceObserver], object]] = {
    "NaN": lambda one: one.step(np.full(12, np.nan), STEP),
    "infinity": lambda one: one.step(np.append(np.zeros(11), np.inf), STEP),
    "1e300": lambda one: one.step(np.append(np.zeros(11), 1e300), STEP),
    "six numbers": lambda one: one.step(np.zeros(6), STEP),
    "text": lambda one: one.step(["0"] * 12, STEP),  # type: ignore[list-item]
    "nothing": lambda one: one.step(None, STEP),  # type: ignore[arg-type]
    "no time": lambda one: one.step(moved(3), 0.0),
    "backwards": lambda one: one.step(moved(3), -STEP),
    "NaN time": lambda one: one.step(moved(3), np.nan),
    "time as text": lambda one: one.step(moved(3), "0.02"),  # type: ignore[arg-type]
    "upright": lambda one: one.step(np.array([0, 0, 0, 0, np.pi / 2 - 1e-9, 0.1, *[0.0] * 6]), STEP),
    "a NaN wrench": lambda one: one.applied(np.full(6, np.nan)),
    "an infinite wrench": lambda one: one.applied(np.array([0, 0, 0, 0, 0, np.inf])),
    "five forces": lambda one: one.applied(np.zeros(5)),
    "a wrench of text": lambda one: one.applied("north"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_refused_call_keeps_the_estimate(
    name: str, one_sentence: Callable[[BaseException], str]
) -> None:
    """What follows is to the last bit what it would have been without the call."""
    one, twin = observer(), observer()
    followed(one, 5)
    with pytest.raises(InputError) as caught:
        WRONG[name](one)
    one_sentence(caught.value)
    expected = followed(twin, 10)
    np.testing.assert_array_equal(one.estimate, expected[4])
    np.testing.assert_array_equal(followed(one, 5, first=5), expected[5:])
    assert np.abs(expected[5:]).max() > 0.01


def test_one_nan_is_not_for_ever() -> None:
    """A controller's setup, states a millimetre apart, a time step of zero in between."""
    one = DisturbanceObserver(Controller(quick_scenario(), learn=False).setup, 1.0)
    zeta = np.zeros(12)
    one.step(zeta, 0.02)
    one.applied(np.zeros(6))
    with pytest.raises(InputError, match="dt is 0, but must be a positive time"):
        one.step(zeta + 1e-3, 0.0)
    one.applied(np.zeros(6))
    assert np.isfinite(one.step(zeta, 0.02)).all()


@pytest.mark.parametrize(
    ("state", "dt", "flag"),
    [
        (moved(5) + np.eye(12)[0] * 3.0, STEP, "jump"),
        (moved(5) + np.eye(12)[6] * 1.5, STEP, "jump"),
        (moved(5), 2.0, "gap"),
        (moved(5) + np.eye(12)[8] * 30.0, STEP, "rate"),
    ],
)
def test_what_says_nothing_of_the_acceleration_leaves_the_estimate(
    state: Array, dt: float, flag: str
) -> None:
    one = observer()
    before = followed(one, 5)[-1]
    np.testing.assert_array_equal(one.step(state, dt), before)
    assert flag in one.flags
    one.applied(FORCE)
    one.step(state, STEP)  # from rest to rest: it goes on from there
    assert flag == "rate" or one.flags == ()


def test_far_from_the_station_it_estimates_as_ever() -> None:
    """The model does not know where it is: the estimate is that of the same motion near by."""
    near, far = observer(), observer()
    away = np.zeros(12)
    away[0] = 1000.0
    for i in range(6):
        for one, zeta in ((near, moved(i)), (far, moved(i) + away)):
            one.step(zeta, STEP)
            one.applied(FORCE)
    assert far.flags == ("far",)
    np.testing.assert_allclose(far.estimate, near.estimate, rtol=1e-12)


def test_arrays_that_the_caller_writes_into_are_not_kept() -> None:
    """One buffer for all states and wrenches, and an estimate that is spoilt by its reader."""
    one, state, wrench = observer(), np.zeros(12), np.zeros(6)
    expected = followed(observer(), 6)
    for i in range(6):
        state[:] = moved(i)
        found = one.step(state, STEP)
        np.testing.assert_array_equal(found, expected[i])
        found[:] = np.nan
        wrench[:] = FORCE
        one.applied(wrench)
        state[:] = wrench[:] = np.nan


@pytest.mark.filterwarnings("error")
def test_whatever_comes_the_estimate_is_finite() -> None:
    one, rng = observer(), np.random.default_rng(7)
    for _ in range(3000):
        size = 10.0 ** rng.uniform(-300.0, 300.0) if rng.random() < 0.3 else 0.3
        dt = rng.choice([STEP, 0.0, 5e-324, 1e-300, 0.2, 2.0, 1e300, np.nan])
        with contextlib.suppress(InputError):
            assert np.isfinite(one.step(size * rng.standard_normal(12), float(dt))).all()
        with contextlib.suppress(InputError):
            one.applied(10.0 ** rng.uniform(-3.0, 308.0) * rng.standard_normal(6))
    assert np.isfinite(one.estimate).all()
