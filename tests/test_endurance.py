"""A controller over a long time: finite, bounded weights, and no memory that grows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from endurance import GROWTH, Row, growth, learned, stepped

from .games import quick_scenario

MOST = 10.0  # of the largest Riccati weight; the projection holds the actors to 3.3 times their norm


def all_rows(rows: Iterator[Row]) -> list[Row]:
    """Return the rows, all of them finite, with weights of the size of the Riccati solution's."""
    largest = float(np.abs(quick_scenario().station_keeping().riccati_weights).max())
    kept = list(rows)
    assert all(row.finite for row in kept)
    assert max(row.weight for row in kept) < MOST * largest
    return kept


def test_steps_and_learning_for_a_moment() -> None:
    """What is drawn contains what is refused and what is flagged."""
    *_, last = all_rows(stepped(quick_scenario(), 4000, seed=1, rows=4))
    assert last.time == 4000
    assert {"refused", "jump", "gap", "rate"} <= set(last.flags)
    *_, last = all_rows(learned(quick_scenario(), 4.0, seed=3, rows=4))
    assert last.time == pytest.approx(4.0)
    assert 0.0 < last.estimate < 50.0


@pytest.mark.slow
def test_memory_stays_over_many_steps() -> None:
    rows = all_rows(stepped(quick_scenario(), 200_000, seed=1, rows=10))
    assert growth(rows) < GROWTH


@pytest.mark.slow
def test_memory_stays_over_ten_minutes_of_learning() -> None:
    rows = all_rows(learned(quick_scenario(), 600.0, seed=1, rows=10))
    assert growth(rows) < GROWTH
    assert rows[-1].flags["refused"] > 5
    assert rows[-1].flags["gap"] > 5
