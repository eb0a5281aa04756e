"""Runs that end early and certificates that fail: exit code 1, the reason, and kept results."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.comparison.records import clairvoyant
from stationkeep.offline import OfflineSolution, OfflineSolver, Trajectory
from stationkeep.online import load
from stationkeep.symbolic import RunError

from .commands import COARSE, LOOSE, QUICK, ROUGH, call, files_in, sets
from .games import Array

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("simulation.chi=0.41", ["left chi", "0.41", "half-widths", " at t = "]),
        ("simulation.pitch_limit=4.5", ["pitch left", "4.5 deg", " at t = "]),
    ],
)
def test_a_run_that_leaves_its_bounds(
    override: str, words: list[str], user_folder: Path, capsys: Capture
) -> None:
    """It starts inside and is pushed out by its rates."""
    state = "simulation.initial_state=[0.8,0,0,0,0.07,0,0.2,0,0,0,0.2,0]"
    words_of_run = ("online", "--json", "--quiet", "--out", "out", *sets(*QUICK, state, override))
    answer = call(capsys, *words_of_run)
    assert answer.code == 1
    assert answer.err == ""
    printed = answer.json()
    for word in words:
        assert word in printed["stopped"]
    assert printed["cost"] is None
    assert np.isfinite(printed["final_state"]).all()
    record = load(user_folder / "out" / "learned.nc")
    assert record.attrs["stopped"] == printed["stopped"]
    assert 0.0 < record["time"].values[-1] < 2.0
    assert files_in(user_folder) == ["out/learned.nc"]
    assert call(capsys, *words_of_run).out == answer.out, "what ended by itself would end so again"


@pytest.mark.parametrize("override", ["simulation.chi=0.1", "simulation.pitch_limit=1"])
def test_a_run_that_starts_out_of_bounds(override: str, user_folder: Path, capsys: Capture) -> None:
    words = ("online", "--json", "--quiet", "--out", "out", *sets(*QUICK, override))
    answer = call(capsys, *words)
    assert answer.code in (1, 2), "a run that can't start is bad input or ends early"
    if answer.code == 1:
        assert "t = 0.00 s" in answer.json()["stopped"]
        assert load(user_folder / "out" / "learned.nc").attrs["stopped"]
    else:
        assert "initial state" in answer.sentence()


def test_the_table_says_why_a_run_ended(capsys: Capture) -> None:
    answer = call(capsys, "online", "--quiet", *sets(*QUICK, "simulation.chi=0.351"))
    assert answer.code in (0, 1)
    assert ("left chi" in answer.out) == (answer.code == 1)


def test_a_certificate_that_fails(user_folder: Path, capsys: Capture) -> None:
    tight = sets(*QUICK, *ROUGH, *LOOSE, "offline.value_tolerance=1e-16")
    answer = call(capsys, "offline", "--json", "--quiet", "--out", "out", *tight)
    assert answer.code == 1
    (row,) = answer.json()["states"]
    assert row["value"] > 0.0
    assert row["certificate"]["value_error"] > 1e-16
    (fault,) = row["faults"]
    assert fault.startswith("value_error is ")
    assert "1e-16" in fault
    written = json.loads((user_folder / "out" / "offline.json").read_text(encoding="utf-8"))
    assert written == answer.json()
    record = load(user_folder / "out" / "optimal-1.nc")
    assert record.attrs["value"] == row["value"]
    assert record.attrs["faults"] == fault


def test_one_state_of_two_that_can_not_be_solved(
    user_folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = OfflineSolver.solve

    calls = []

    def solve(self: OfflineSolver, zeta0: Array, guess: Trajectory | None = None) -> OfflineSolution:
        calls.append(zeta0[0])
        if zeta0[0] > 0.5:
            raise RunError("IPOPT stopped with 'Infeasible_Problem_Detected' after 7 iterations")
        return original(self, zeta0, guess)

    monkeypatch.setattr(OfflineSolver, "solve", solve)
    far, near = ",".join(["0.6", *["0"] * 11]), ",".join(["0.3", *["0"] * 11])
    words = ("--state", far, "--state", near, "--workers", "1", *sets(*QUICK, *ROUGH, *LOOSE))
    answer = call(capsys, "offline", "--json", "--quiet", *words)
    assert answer.code == 1
    failed, solved = answer.json()["states"]
    assert failed["value"] is None
    assert failed["costate"] is None
    assert set(failed["certificate"].values()) == {None}
    assert "Infeasible_Problem_Detected" in failed["faults"][0]
    assert solved["faults"] == []
    assert solved["value"] > 0.0
    names = ("offline.csv", "offline.json", "optimal-1.nc", "optimal-2.nc")
    assert files_in(user_folder) == [f"results/bluerov2-heavy/{name}" for name in names]
    record = load(user_folder / "results" / "bluerov2-heavy" / "optimal-1.nc")
    assert record.attrs["failed"] == failed["faults"][0]
    again = call(capsys, "offline", "--json", "--quiet", *words)
    assert again.code == 1
    assert again.out == answer.out
    assert sorted(calls) == [0.3, 0.6], "a failure is kept like any result"


def test_the_station_itself_has_the_value_zero(capsys: Capture) -> None:
    """ζ = 0 is a state like any other: V = 0, no force, and nothing to complain about."""
    zeros = ",".join(["0"] * 12)
    settings = sets(*QUICK, *ROUGH)
    answer = call(capsys, "offline", "--json", "--quiet", "--state", zeros, *settings)
    (row,) = answer.json()["states"]
    assert row["value"] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(row["u_control"]).max() < 1e-9
    assert row["faults"] == []
    assert answer.code == 0


@pytest.mark.slow
def test_compare_of_runs_that_end_early(user_folder: Path, capsys: Capture) -> None:
    settings = sets(*QUICK, *COARSE, "simulation.chi=0.36")
    answer = call(capsys, "compare", "--json", "--quiet", "--n-states", "1", "--out", "out", *settings)
    assert answer.code == 1
    printed = answer.json()
    for distribution in printed["regret"].values():
        assert distribution["diverged"] == 1
        assert {distribution[name] for name in ("median", "p90", "max")} == {None}
    assert any("left chi" in fault for fault in printed["faults"])
    report = (user_folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "left chi" in report
    assert "there is no regret to compare" in report


@pytest.mark.slow
def test_compare_of_runs_that_start_out_of_bounds(capsys: Capture) -> None:
    settings = sets(*QUICK, *COARSE, "simulation.chi=0.1")
    assert call(capsys, "compare", "--json", "--quiet", "--n-states", "1", *settings).code in (1, 2)


@pytest.mark.slow
def test_compare_in_disturbed_mode_has_regret_against_the_clairvoyant_optimum(
    user_folder: Path, capsys: Capture
) -> None:
    disturbance = ("kind='constant'", "force=[1,0,0,0,0,0]")
    settings = sets(*QUICK, *COARSE, "simulation.mode='disturbed'")
    settings += sets(*(f"simulation.disturbance.{text}" for text in disturbance))
    words = ("compare", "--json", "--quiet", "--n-states", "1", "--workers", "1", "--out", "out")
    answer = call(capsys, *words, *settings)
    assert answer.code == 0
    printed = answer.json()
    assert set(printed["regret"]) >= {"learned", "linear"}
    assert all(one["median"] > -1e-9 for one in printed["regret"].values() if not one["diverged"])
    assert "V_c is the clairvoyant" in printed["notes"]["regret"]
    assert 0.0 < printed["clairvoyant"]["value_error"] < 1e-5
    kept = load(user_folder / "out" / "records" / "clairvoyant.nc")
    assert kept.attrs["value"] == printed["clairvoyant"]["value"]
    linear = load(user_folder / "out" / "records" / "linear.nc")["cost"].values[-1]
    regret = (linear - kept.attrs["value"]) / kept.attrs["value"]
    assert printed["regret"]["linear"]["median"] == pytest.approx(regret, rel=1e-12)
    assert all(printed["dissipation_margin"][name] > 0.0 for name in ("learned", "linear"))
    assert (user_folder / "out" / "report.html").is_file()


@pytest.mark.slow
def test_compare_goes_on_without_a_clairvoyant_optimum(
    user_folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(scenario: Scenario) -> None:
        raise RunError("IPOPT stopped with 'Maximum_Iterations_Exceeded'")

    monkeypatch.setattr(clairvoyant, "clairvoyant", failing)
    settings = sets(
        *QUICK, *COARSE, "simulation.mode='disturbed'", "simulation.disturbance.kind='waves'"
    )
    words = ("compare", "--json", "--quiet", "--n-states", "1", "--workers", "1", "--out", "out")
    answer = call(capsys, *words, *settings)
    assert answer.code == 1
    printed = answer.json()
    assert set(printed["regret"].values()) == {None}
    assert printed["clairvoyant"] is None
    assert "no clairvoyant optimum" in printed["notes"]["clairvoyant"]
    assert printed["faults"] == [
        "clairvoyant optimum: IPOPT stopped with 'Maximum_Iterations_Exceeded'"
    ]
    report = (user_folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "There is no clairvoyant optimum" in report
