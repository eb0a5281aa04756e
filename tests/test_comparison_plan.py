"""The plan of many solves: every state once, after a near one of its chunk, from the states alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stationkeep.comparison.optima.plan import LARGEST, NEAR, plan

from .games import HALF_WIDTHS, Array

UNIT = np.ones(12)


def clouds(seed: int, n: int, spread: float) -> Array:
    """Return n states around a few centres."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1.0, 1.0, (1 + n // 5, 12))
    return np.asarray(
        centres[rng.integers(len(centres), size=n)] + spread * rng.standard_normal((n, 12))
    )


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 1000),
    n=st.integers(1, 60),
    spread=st.sampled_from([0.0, 1e-9, 0.01, 0.1, 1.0]),
)
def test_every_state_once_after_one_that_is_near(seed: int, n: int, spread: float) -> None:
    states = clouds(seed, n, spread)
    chunks = plan(states, UNIT)
    assert sorted(step.state for chunk in chunks for step in chunk) == list(range(n))
    for chunk in chunks:
        assert 1 <= len(chunk) <= LARGEST
        assert chunk[0].after is None
        solved = [chunk[0].state]
        for step in chunk[1:]:
            assert step.after in solved
            gaps = [float(np.linalg.norm(states[step.state] - states[s])) for s in solved]
            gap = float(np.linalg.norm(states[step.state] - states[step.after]))
            assert gap <= NEAR * np.linalg.norm(states[step.state])
            assert gap == pytest.approx(min(gaps), abs=1e-12), "there is a nearer one"
            solved.append(step.state)


def test_the_plan_follows_from_the_states_alone() -> None:
    states = clouds(5, 40, 0.02)
    assert plan(states, UNIT) == plan(states.copy(), UNIT)


def test_distances_are_in_half_widths() -> None:
    states = clouds(7, 40, 0.02)
    assert plan(states * HALF_WIDTHS, HALF_WIDTHS) == plan(states, UNIT)


def test_random_states_of_the_envelope_have_no_near_neighbours() -> None:
    """In twelve dimensions the next of 200 states is far, so all can be solved at the same time."""
    states = np.random.default_rng(3).uniform(-1.0, 1.0, (200, 12))
    assert len(plan(states, UNIT)) == 200


def test_a_line_is_followed_outwards() -> None:
    line = np.outer(1.02 ** np.arange(LARGEST), UNIT)[::-1]
    (chunk,) = plan(line, UNIT)
    assert [step.state for step in chunk] == list(range(LARGEST))[::-1]
    assert [step.after for step in chunk] == [None, *range(LARGEST - 1, 0, -1)]


def test_the_station_and_doubles() -> None:
    """At the origin nothing is near for its size; a double is."""
    states = np.array([np.zeros(12), UNIT, UNIT, np.zeros(12)])
    chunks = plan(states, UNIT)
    assert sorted(len(chunk) for chunk in chunks) == [1, 1, 2]
    assert plan(np.empty((0, 12)), UNIT) == []
