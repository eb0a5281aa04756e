"""A record runs again from what it holds alone, and the comparison says what is not the same."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.optima import Optima, record_path
from stationkeep.comparison.policies import CONTENDERS
from stationkeep.comparison.records import (
    BIT_EQUAL,
    DIFFERENT,
    contender_record,
    online_record,
    optimal_record,
    replay,
)
from stationkeep.comparison.records.recorded import load_run, recorded_scenario
from stationkeep.comparison.records.replay import WITHIN, compared, gap
from stationkeep.offline import OfflineSolver
from stationkeep.online import load, save
from stationkeep.symbolic import InputError

from .commands import QUICK, ROUGH
from .games import quick_scenario

VEHICLES = Path(__file__).resolve().parents[1] / "symbolic" / "underwater" / "vehicles"
SHORT = "simulation.duration=0.5"
BASIS = """
import casadi
from stationkeep.symbolic import quadratic

def mine(x):
    return casadi.vertcat(quadratic(x), x[0] ** 4)
"""


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of a learned record of half a second."""
    path = tmp_path_factory.mktemp("records") / "learned.nc"
    online_record(quick_scenario(SHORT), path)
    return path


def edited(path: Path, folder: Path, **attributes: Any) -> Path:
    """Return a copy of a record with other attributes."""
    changed = load(path)
    changed.attrs |= attributes
    return save(changed, folder / "edited.nc")


def settings_edited(path: Path, folder: Path, edit: Callable[[dict[str, Any]], object]) -> Path:
    data = json.loads(load(path).attrs["scenario"])
    edit(data)
    return edited(path, folder, scenario=json.dumps(data))


def test_a_fresh_record_is_bit_equal(record: Path) -> None:
    answer = replay(record)
    assert answer.verdict == BIT_EQUAL
    assert answer.max_difference == 0.0
    assert answer.first is None
    assert answer.changed == []
    assert set(answer.differences) >= {"zeta", "critic", "time", "rank_margin", "stopped"}
    again = load(record)
    np.testing.assert_array_equal(again["zeta"], answer.record["zeta"])
    assert again.attrs["key"] == answer.record.attrs["key"]


@pytest.mark.parametrize("name", [name for name in CONTENDERS if name != "learned"])
def test_every_contender_runs_again(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.nc"
    made = contender_record(quick_scenario("simulation.duration=0.2"), name, path)
    answer = replay(path)
    assert (answer.verdict, answer.kind, answer.changed) == (BIT_EQUAL, name, [])
    np.testing.assert_array_equal(answer.record["tau_b"], made["tau_b"])


@pytest.mark.slow
def test_the_files_that_a_scenario_named_may_be_gone(record: Path, tmp_path: Path) -> None:
    """Vehicle, driven vehicle, basis and weights are in the record; nothing is read but the record."""
    files = tmp_path / "files"
    files.mkdir()
    vehicle = (VEHICLES / "bluerov2-heavy.toml").read_text(encoding="utf-8")
    vehicle = re.sub(r"mass = 13.5 ", "mass = 14.5 ", vehicle)
    (files / "mine.toml").write_text(vehicle, encoding="utf-8")
    shutil.copy(VEHICLES / "bluerov2-heavy-2024.toml", files / "driven.toml")
    (files / "basis.py").write_text(BASIS, encoding="utf-8")
    weights = np.append(load(record)["critic"].values[-1], 0.1)
    save(xr.Dataset({"ideal_weights": ("basis", weights)}), files / "weights.nc")
    overrides = {
        "vehicle": f"'{files / 'mine.toml'}'",
        "simulation.plant": f"'{files / 'driven.toml'}'",
        "simulation.mode": "disturbed",
        "basis.name": f"'{files / 'basis.py'}:mine'",
        "learner.weights": f"'{files / 'weights.nc'}'",
        "learner.weight_factor": "0.9",
        "simulation.duration": "0.3",
    }
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, *(f"{k}={v}" for k, v in overrides.items())])
    path = tmp_path / "record.nc"
    made = online_record(scenario, path)
    np.testing.assert_allclose(made["critic"].values[0], 0.9 * weights, rtol=1e-15)
    shutil.rmtree(files)
    answer = replay(path)
    assert answer.verdict == BIT_EQUAL
    assert answer.changed == []
    restored = recorded_scenario(load_run(path))
    assert restored.station_keeping().model.vehicle.mass == 14.5
    assert restored.station_keeping().basis.n_basis == 79


def test_an_optimum_runs_again(tmp_path: Path) -> None:
    basis, path = tmp_path / "basis.py", tmp_path / "optimal.nc"
    basis.write_text(BASIS, encoding="utf-8")
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, *ROUGH, f"basis.name='{basis}:mine'"])
    solver = OfflineSolver(scenario.station_keeping().problem, scenario.offline)
    optimal_record(scenario, solver, path)
    basis.unlink()
    answer = replay(path)
    assert (answer.verdict, answer.changed) == (BIT_EQUAL, [])
    assert {"zeta", "costate", "value", "node", "mesh", "faults"} <= set(answer.differences)


@pytest.mark.slow
def test_an_optimum_that_started_from_another_needs_it(tmp_path: Path) -> None:
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, *ROUGH])
    states = scenario.initial_state * np.array([[1.0], [1.001]])
    optima = Optima(scenario, states, tmp_path)
    assert optima.solve(1, lambda done, solved: None) == {}
    first, second = record_path(tmp_path, 0), record_path(tmp_path, 1)
    assert "started from" in load(second).attrs["kind"]
    assert replay(second).verdict == BIT_EQUAL
    first.unlink()
    with pytest.raises(InputError, match="no longer in"):
        replay(second)


def test_small_and_large_differences(record: Path) -> None:
    then, now = load(record), load(record)
    scale = float(np.abs(then["zeta"]).max())
    now["zeta"][10, 4] += 1e-9 * scale
    answer = compared(then, now)
    assert answer.verdict == WITHIN
    assert answer.max_difference == pytest.approx(1e-9, rel=1e-3)
    assert answer.first == ("zeta", pytest.approx(0.2))
    now["tau_b"][5, 2] += 1e-3 * float(np.abs(then["tau_b"]).max())
    answer = compared(then, now)
    assert answer.verdict == DIFFERENT
    assert answer.differences["tau_b"] == pytest.approx(1e-3)
    assert answer.differences["zeta"] == pytest.approx(1e-9, rel=1e-3)
    assert answer.first == ("tau_b", pytest.approx(0.1))
    assert compared(then, now, tolerance=0.01).verdict == WITHIN


def test_a_run_that_ended_earlier_differs_where_it_ended(record: Path) -> None:
    then = load(record)
    now = then.isel(time=slice(0, 20))
    answer = compared(then, now)
    assert answer.verdict == DIFFERENT
    assert answer.max_difference == np.inf
    assert answer.first is not None
    assert answer.first[1] == pytest.approx(float(then["time"][20]))
    now = load(record)
    now.attrs["stopped"] = "the state left chi"
    assert compared(then, now).first == ("stopped", None)
    assert compared(then, then.drop_vars("critic")).differences["critic"] == np.inf


def test_differences_are_relative_to_the_variable() -> None:
    then = np.array([[3.0, -4.0], [np.nan, 1.0], [np.inf, 0.0]])
    np.testing.assert_array_equal(gap(then, then.copy()), np.zeros(3))
    now = then.copy()
    now[0, 0], now[2, 1] = 3.2, -0.4
    np.testing.assert_allclose(gap(then, now), [0.05, 0.0, 0.1])
    assert gap(then, np.where(np.isnan(then), 0.0, then))[1] == np.inf
    np.testing.assert_array_equal(gap(then, then[:, :1]), np.full(3, np.inf))
    assert gap(np.array(2.0), np.array(2.0 + 2e-7))[0] == pytest.approx(1e-7)
    assert gap(np.zeros(2), np.array([0.0, 1e-3]))[1] == 1e-3  # nothing to be relative to
    np.testing.assert_array_equal(gap(np.array(["x", "y"]), np.array(["x", "z"])), [0.0, np.inf])


def test_other_settings_than_the_run_had_give_other_numbers(record: Path, tmp_path: Path) -> None:
    path = settings_edited(record, tmp_path, lambda data: data["samples"].update(seed=9))
    answer = replay(path)
    assert answer.verdict == DIFFERENT
    assert answer.first is not None
    assert answer.first[1] == 0.0, "the samples are drawn before the first step"
    assert answer.differences["sample_error"] > 1e-6
    assert answer.changed == ["the record's settings are not those that it was made with"]


def test_what_has_changed_is_told(record: Path, tmp_path: Path) -> None:
    answer = compared(load(edited(record, tmp_path, numpy_version="1.0", machine="VAX")), load(record))
    assert [change.split()[0] for change in answer.changed] == ["numpy", "machine"]
    answer = compared(load(edited(record, tmp_path, functions="0")), load(record))
    assert "generated code" in answer.changed[0]


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"format": 1}, "format 1"),
        ({"kind": "sorcery"}, "sorcery"),
        ({"kind": "optimal from [1, 2"}, "initial state"),
        ({"stopped": "interrupted at t = 0.20 s"}, "interrupted"),
        ({"scenario": "{"}, "scenario"),
        ({"scenario": "[1]"}, "scenario"),
        ({"vehicle": "nothing"}, "vehicle"),
        ({"vehicle": "{}"}, "name"),
    ],
)
def test_attributes_that_cannot_be_used(
    attributes: dict[str, Any],
    words: str,
    record: Path,
    tmp_path: Path,
    one_sentence: Callable[[BaseException], str],
) -> None:
    with pytest.raises(InputError) as caught:
        replay(edited(record, tmp_path, **attributes))
    assert words in one_sentence(caught.value)


def test_settings_of_another_version(
    record: Path, tmp_path: Path, one_sentence: Callable[[BaseException], str]
) -> None:
    path = settings_edited(record, tmp_path, lambda data: data["learner"].update(momentum=1))
    with pytest.raises(InputError) as caught:
        replay(path)
    text = one_sentence(caught.value)
    assert "momentum" in text
    assert "version" in text


def test_a_damaged_basis(
    record: Path, tmp_path: Path, one_sentence: Callable[[BaseException], str]
) -> None:
    changed = load(record)
    changed["basis_function"] = ((), "gibberish", {"units": "1"})
    with pytest.raises(InputError) as caught:
        replay(save(changed, tmp_path / "edited.nc"))
    text = one_sentence(caught.value)
    assert all(word in text for word in ("basis", "damaged", "make it again")), text
