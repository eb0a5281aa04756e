"""Optima from many states: what starts from what, kept bit for bit, and made again only if needed."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.optima import CERTIFICATE, Optima, record_path
from stationkeep.comparison.records import optimum_or_failure, optimum_provenance, trajectory_of
from stationkeep.offline import OfflineSolution, OfflineSolver, Trajectory
from stationkeep.online import load
from stationkeep.online.records import read_parts, remove_temporaries
from stationkeep.symbolic import InputError, RunError

from .commands import LOOSE, QUICK
from .games import HALF_WIDTHS, Array

Check = Callable[[BaseException], str]
TINY = (
    *("offline.horizon=12", "offline.intervals=6", "offline.degree=4", "offline.aligned=false"),
    *("offline.rounds=1", "offline.starts=0"),
)
FIRST = 0.2 * HALF_WIDTHS * np.linspace(-1.0, 1.0, 12)
CHAIN = np.array([FIRST, -FIRST, 1.03 * FIRST, 1.06 * FIRST])
"""The third starts from the first, the fourth from the third."""


@cache
def tiny() -> tuple[Scenario, OfflineSolver]:
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, *TINY, *LOOSE])
    return scenario, OfflineSolver(scenario.station_keeping().problem, scenario.offline)


def quiet(done: int, solved: int) -> None:
    """Show no progress."""


def solve(folder: Path, states: Array = CHAIN, scenario: Scenario | None = None) -> dict[int, str]:
    return Optima(scenario or tiny()[0], states, folder).solve(1, quiet)


def same(first: xr.Dataset, second: xr.Dataset) -> None:
    """Both records hold the same bits, times apart."""
    for record in (first, second):
        record.attrs = {k: v for k, v in record.attrs.items() if "seconds" not in k}
    xr.testing.assert_identical(first, second)


def test_a_trajectory_comes_back_bit_for_bit(tmp_path: Path) -> None:
    solver = tiny()[1]
    solution = solver.solve(FIRST)
    solve(tmp_path, FIRST[None, :])
    back = trajectory_of(load(record_path(tmp_path, 0)))
    for field in fields(Trajectory):
        kept, made = (getattr(path, field.name) for path in (back, solution.direct.trajectory))
        np.testing.assert_array_equal(kept, made)
        assert np.asarray(kept).dtype == np.asarray(made).dtype
    attributes, parts = read_parts(record_path(tmp_path, 0), "costate", "zeta")
    assert attributes == load(record_path(tmp_path, 0)).attrs
    np.testing.assert_array_equal(parts["costate"], solution.costate)
    np.testing.assert_array_equal(parts["zeta"], solution.direct.trajectory.states)
    assert [attributes[name] for name in CERTIFICATE] == [
        getattr(solution.certificate, name) for name in CERTIFICATE
    ]


def test_a_chain_is_that_of_the_plan(tmp_path: Path) -> None:
    """Each record is what the solver finds from the one before it, to the last bit."""
    scenario, solver = tiny()
    assert solve(tmp_path) == {}
    records = [load(record_path(tmp_path, i)) for i in range(4)]
    for i, after in ((0, None), (1, None), (2, 0), (3, 2)):
        guess = None if after is None else trajectory_of(records[after])
        key = "" if after is None else records[after].attrs["key"]
        attributes = optimum_provenance(scenario, CHAIN[i], key)
        assert records[i].attrs["key"] == attributes["key"]
        same(records[i].copy(), optimum_or_failure(scenario, solver, CHAIN[i], attributes, guess))


def test_what_is_missing_is_made_again_and_nothing_else(tmp_path: Path) -> None:
    solve(tmp_path)
    before = load(record_path(tmp_path, 2))
    kept = {i: record_path(tmp_path, i).stat().st_mtime_ns for i in (0, 1, 3)}
    record_path(tmp_path, 2).write_bytes(b"half a record")
    told: list[tuple[int, int]] = []
    Optima(tiny()[0], CHAIN, tmp_path).solve(1, lambda done, solved: told.append((done, solved)))
    same(before, load(record_path(tmp_path, 2)))
    assert {i: record_path(tmp_path, i).stat().st_mtime_ns for i in kept} == kept
    assert [done for done, _ in told] == [1, 2, 3, 4]
    assert told[-1] == (4, 1)


def test_another_first_state_makes_those_after_it_again(tmp_path: Path) -> None:
    """They started from its optimum, so they are not those of the new states."""
    solve(tmp_path)
    before = [record_path(tmp_path, i).stat().st_mtime_ns for i in range(4)]
    moved = CHAIN.copy()
    moved[0] *= 1.001
    solve(tmp_path, moved)
    after = [record_path(tmp_path, i).stat().st_mtime_ns for i in range(4)]
    assert [a == b for a, b in zip(after, before, strict=True)] == [False, True, False, False]


def test_other_settings_make_all_again(tmp_path: Path) -> None:
    solve(tmp_path, CHAIN[:2])
    other = tiny()[0].with_settings(offline={"intervals": 7})
    solve(tmp_path, CHAIN[:2], other)
    assert all(load(record_path(tmp_path, i))["mesh"].size == 8 for i in range(2))


def test_a_search_that_fails_from_a_neighbour_starts_again_from_the_linear_policy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = OfflineSolver.solve
    guesses: list[bool] = []

    def solving(self: OfflineSolver, zeta0: Array, guess: Trajectory | None = None) -> OfflineSolution:
        guesses.append(guess is not None)
        if guess is not None and len(guesses) == 3:
            raise RunError("not from there")
        answer = original(self, zeta0, guess)
        return replace(answer, faults=["a fault"]) if guess is not None else answer

    monkeypatch.setattr(OfflineSolver, "solve", solving)
    solve(tmp_path)
    assert guesses == [False, True, False, True, False, False] or guesses == [
        *(False, False, True, False, True, False)
    ]
    for i in (2, 3):
        record = load(record_path(tmp_path, i))
        assert "failed" not in record.attrs
        assert record.attrs["faults"] == ""


def test_after_a_failure_the_one_before_it_is_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = OfflineSolver.solve

    def solving(self: OfflineSolver, zeta0: Array, guess: Trajectory | None = None) -> OfflineSolution:
        if zeta0[0] == CHAIN[2, 0]:
            raise RunError("IPOPT stopped with 'Restoration_Failed' after 3 iterations")
        return original(self, zeta0, guess)

    monkeypatch.setattr(OfflineSolver, "solve", solving)
    solve(tmp_path)
    first, failed, last = (read_parts(record_path(tmp_path, i))[0] for i in (0, 2, 3))
    assert "Restoration_Failed" in failed["failed"]
    assert last["kind"].endswith(f"started from {first['key']}")
    row = [*Optima(tiny()[0], CHAIN, tmp_path).rows({})][2]
    assert row["faults"] == [failed["failed"]]
    assert row["value"] is None
    np.testing.assert_array_equal(row["zeta"], CHAIN[2])


def test_a_state_that_was_given_up_is_a_row(tmp_path: Path) -> None:
    solve(tmp_path, CHAIN[:2])
    rows = [*Optima(tiny()[0], CHAIN[:2], tmp_path).rows({1: "its process was killed"})]
    assert rows[1]["faults"] == ["its process was killed"]
    assert rows[1]["value"] is None
    assert rows[0]["value"] > 0.0


def test_policies_of_a_row(tmp_path: Path) -> None:
    """(8) and (9): u_1 = -R^-1 g'V_ζ / 2 and u_2 = γ^-2 W_d^-1 g'V_ζ / 2 at the state itself."""
    scenario, _ = tiny()
    station = scenario.station_keeping()
    solve(tmp_path, CHAIN[:1])
    (row,) = Optima(scenario, CHAIN[:1], tmp_path).rows({})
    push = station.model.input_matrix(FIRST).T @ row["costate"]
    R = np.array([1.0, 1, 1, 10, 10, 10])
    np.testing.assert_allclose(row["u_control"], -push / R / 2, rtol=1e-12)
    np.testing.assert_allclose(row["u_disturbance"], push / R / 4 / 2, rtol=1e-12)


def test_a_scenario_is_shipped_as_its_text(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        'vehicle = "bluerov2-heavy"\n[game]\nQ = [1,1,1,1,1,1,1,1,1,1,1,0.1]\nR = [1,1,1,1,1,1]\n'
        "gamma = 3.3\n[envelope]\nhalf_widths = [1,1,1,1,1,1,1,1,1,1,1,0.3]\n[basis]\n"
        'name = "mine.py:few"\n[simulation]\ninitial_state = [0,0,0,0,0,0,0,0,0,0,0,0.1]\n',
        encoding="utf-8",
    )
    basis = "from stationkeep.symbolic import quadratic\n\ndef few(x):\n    return quadratic(x)\n"
    (tmp_path / "mine.py").write_text(basis, encoding="utf-8")
    scenario = Scenario.load(path)
    scenario.station_keeping()
    back = pickle.loads(pickle.dumps(scenario))
    assert back == scenario
    assert back.model_dump_json() == scenario.model_dump_json()
    assert back.station_keeping().basis.n_basis == 78, "its files are found beside it"
    assert back.station_keeping().fingerprint == scenario.station_keeping().fingerprint


def test_parts_of_what_is_no_record(tmp_path: Path, one_sentence: Check) -> None:
    solve(tmp_path, CHAIN[:1])
    (tmp_path / "noise.nc").write_bytes(bytes(range(256)))
    whole = record_path(tmp_path, 0).read_bytes()
    (tmp_path / "half.nc").write_bytes(whole[: len(whole) // 2])
    for name in ("none.nc", "noise.nc", "half.nc"):
        with pytest.raises(InputError, match=name) as caught:
            read_parts(tmp_path / name)
        one_sentence(caught.value)
    with pytest.raises(InputError, match="can't be read"):
        read_parts(record_path(tmp_path, 0), "no such variable")


def test_only_what_a_killed_run_left_is_removed(tmp_path: Path) -> None:
    mine = (".optimal-1.nc", "optimal-1.nc-12-0123abcd", ".notes-12-0123abcd", ".optimal-1.nc-a-b")
    left = (".optimal-1.nc-12-0123abcd", ".optimal-200.nc-99999-ffffffff")
    for name in (*mine, *left):
        (tmp_path / name).write_text("", encoding="utf-8")
    remove_temporaries(tmp_path, "optimal-*.nc")
    assert {path.name for path in tmp_path.iterdir()} == set(mine)
