"""Regret over random states: quantiles with failures, targets, runs that are kept, and the figures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.comparison.evidence.kept import Keep, key_of
from stationkeep.comparison.evidence.regret import (
    MOONSHOT,
    REQUIRED,
    Case,
    Row,
    Summary,
    Target,
    regrets,
    target,
)
from stationkeep.comparison.parallel import Work
from stationkeep.comparison.policies import LinearPolicy
from stationkeep.online import draw_samples
from stationkeep.symbolic import InputError

from .games import Array, quick_scenario


def test_failures_are_in_every_quantile() -> None:
    finished = [0.01 * k for k in range(1, 8)]
    all_well = Summary.of(reversed(finished))
    assert (all_well.n, all_well.failed) == (7, 0)
    assert (all_well.median, all_well.largest) == (finished[3], finished[6])
    lost = Summary.of([*finished, np.inf])
    assert (lost.n, lost.failed, lost.largest) == (8, 1, np.inf)
    assert lost.median == finished[4]
    assert Summary.of([0.1, np.inf, np.inf]).median == np.inf


def test_a_run_without_cost_or_optimum_is_a_failure() -> None:
    assert Row(2.0, 2.5, None, 1.0, 1.0).regret == pytest.approx(0.25)
    assert Row(2.0, np.inf, "left chi", 1.0, 1.0).regret == np.inf
    assert Row(np.nan, 2.0, "no optimum", 1.0, 1.0).regret == np.inf


def test_targets_are_parts_of_what_the_linear_policy_loses() -> None:
    linear = Summary.of([0.3, 0.3, 0.9])
    limit = Target(1 / 3, 1 / 2)
    for regret, median, largest in ((0.09, True, True), (0.11, False, True), (0.5, False, False)):
        assert limit.met(Summary.of([regret] * 3), linear) == (median, largest)
    assert limit.met(Summary.of([0.0, 0.0, np.inf]), linear) == (True, False)
    # a linear policy that fails excuses nobody
    for regret in (0.1, np.inf):
        assert limit.met(Summary.of([regret]), Summary.of([np.inf])) == (False, False)
        assert limit.met(Summary.of([regret]), Summary.of([])) == (False, False)


@pytest.mark.parametrize(
    ("scale", "required", "moonshot"),
    [
        (0.1, (1 / 3, 1 / 2), (1 / 8, 1 / 5)),
        (0.35, (1 / 3, 1 / 2), (1 / 8, 1 / 5)),
        (0.6, (1 / 3, 1 / 2), (1 / 8, 1 / 5)),
        (1.0, (1 / 2, 2 / 3), (1 / 5, 1 / 3)),
        (1.5, (1 / 2, 2 / 3), (1 / 5, 1 / 3)),
    ],
)
def test_target_of_a_scale(
    scale: float, required: tuple[float, float], moonshot: tuple[float, float]
) -> None:
    assert target(REQUIRED, scale) == Target(*required)
    assert target(MOONSHOT, scale) == Target(*moonshot)


def squares(folder: Path) -> Work[int, dict[str, int]]:
    def work(task: int) -> Iterator[dict[str, int]]:
        with (folder / "worked").open("a") as file:
            file.write(f"{task}\n")
        yield {"square": task * task}

    return work


def worked(folder: Path) -> list[int]:
    return [int(line) for line in (folder / "worked").read_text().split()]


def test_what_was_finished_is_not_done_again(tmp_path: Path) -> None:
    told: list[tuple[int, int, int]] = []
    keep = Keep(tmp_path / "kept" / "a.jsonl", progress=lambda *numbers: told.append(numbers))
    tasks = [3, 1, 2]
    keys = [f"key {task}" for task in tasks]
    first = keep.results(squares, tmp_path, tasks[:2], keys[:2])
    assert first == [{"square": 9}, {"square": 1}]
    assert keep.results(squares, tmp_path, tasks, keys) == [*first, {"square": 4}]
    assert worked(tmp_path) == [3, 1, 2]
    assert told == [(1, 1, 2), (2, 2, 2), (3, 1, 3)]
    assert keep.results(squares, tmp_path, tasks, ["another key", *keys[1:]]) == [*first, {"square": 4}]
    assert worked(tmp_path) == [3, 1, 2, 3]


@pytest.mark.parametrize("left", ['{"key": "key 5", "squ', "[1, 2]", '{"square": 25}', "\xff", ""])
def test_a_line_that_a_killed_process_left_is_done_again(tmp_path: Path, left: str) -> None:
    keep = Keep(tmp_path / "a.jsonl")
    keep.results(squares, tmp_path, [4], ["key 4"])
    with keep.file.open("ab") as file:
        file.write(left.encode("latin-1"))
    both = [{"square": 16}, {"square": 25}]
    for _ in range(2):
        assert keep.results(squares, tmp_path, [4, 5], ["key 4", "key 5"]) == both
    assert worked(tmp_path) == [4, 5]


def test_a_file_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    keep = Keep(tmp_path / "file" / "a.jsonl")
    with pytest.raises(InputError, match=r"can't be written .*choose another folder"):
        keep.results(squares, tmp_path, [4], ["key 4"])


def test_keys_tell_inputs_apart() -> None:
    assert key_of("a", 1) == key_of("a", 1)
    assert len({key_of("a", 1), key_of("a", 2), key_of("a1"), key_of("a", "", 1)}) == 4


def test_runs_are_kept_and_failures_counted(tmp_path: Path) -> None:
    """With chi below the states every run ends at once, and none is dropped."""
    scenario = quick_scenario("simulation.duration=0.2")
    states = draw_samples(scenario.station_keeping().envelope, 2, 20)
    made: list[int] = []
    keep = Keep(tmp_path / "runs.jsonl", progress=lambda there, new, total: made.append(total))
    cases = [
        Case("linear", "linear"),
        Case("frozen", learn=False),
        Case("lost", changes={"simulation": {"chi": 1e-3}}),
    ]
    found = regrets(scenario, cases, states, keep)
    assert made == [6] * 6
    # frozen Riccati weights are the linear policy with g of ζ instead of g(0)
    for one, other in zip(found["linear"], found["frozen"], strict=True):
        assert one.value == other.value
        assert one.cost == pytest.approx(other.cost, rel=1e-2)
        assert one.cost != other.cost
        assert one.simulated == pytest.approx(0.2)
    for row in found["lost"]:
        assert row.regret == np.inf
        assert "left chi" in str(row.stopped)
    assert Summary.of(row.regret for row in found["lost"]).failed == 2
    again = regrets(scenario, cases[::-1], states, keep)
    assert len(made) == 6
    assert again == found
    entries = [json.loads(line) for line in keep.file.read_text().splitlines()]
    np.testing.assert_array_equal([entry["zeta"] for entry in entries[::3]], states)


def test_a_run_that_the_user_ended_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = quick_scenario("simulation.duration=0.2")
    states = draw_samples(scenario.station_keeping().envelope, 2, 20)
    keep = Keep(tmp_path / "runs.jsonl")
    steps = iter(range(1000))

    def interrupted(policy: LinearPolicy, zeta: Array, dt: float) -> Array:
        if next(steps) == 15:
            raise KeyboardInterrupt
        return -policy.gain @ zeta

    with monkeypatch.context() as patch:
        patch.setattr(LinearPolicy, "control", interrupted)
        with pytest.raises(KeyboardInterrupt):
            regrets(scenario, [Case("linear", "linear")], states, keep)
    assert len(keep.file.read_text().splitlines()) == 1
    rows = regrets(scenario, [Case("linear", "linear")], states, keep)["linear"]
    assert [row.stopped for row in rows] == [None, None]


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.35, 1.0])
def test_learning_while_it_is_scored_loses_a_part_of_what_the_linear_policy_loses(
    tmp_path: Path, scale: float
) -> None:
    """A seeded part of the table of `benchmarks/regret.py`, held to what is required of all of it."""
    scenario = Scenario.load("bluerov2-heavy", [f"envelope.scale={scale}"])
    states = draw_samples(scenario.station_keeping().envelope, 8, 20)
    cases = [Case("linear", "linear"), Case("online")]
    found = regrets(scenario, cases, states, Keep(tmp_path / "runs.jsonl"))
    linear, online = (Summary.of(row.regret for row in found[case.name]) for case in cases)
    assert (linear.failed, online.failed) == (0, 0)
    # V* is the least there is, found to a few millionths
    assert min(row.regret for rows in found.values() for row in rows) > -1e-5
    assert target(REQUIRED, scale).met(online, linear) == (True, True), (online, linear)
