"""Records are reused while nothing that their numbers depend on has changed, and only then."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.records import OFFLINE_KEY, online_record, optimal_record, provenance
from stationkeep.offline import OfflineSolver
from stationkeep.online import load

from .commands import QUICK, ROUGH
from .games import linear_on, quick_scenario

BASIS = """
import casadi
from stationkeep.symbolic import quadratic

def more(x):
    return casadi.vertcat(quadratic(x), {power})
"""


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Return the path of the record of the quick scenario."""
    path = tmp_path / "learned.nc"
    online_record(quick_scenario(), path)
    return path


def key(scenario: Scenario, include: set[str] | None = None) -> str:
    """Return the hash of what the numbers of a record depend on."""
    return str(provenance(scenario, "learned", include)["key"])


def is_made_again(scenario: Scenario, path: Path) -> bool:
    before = path.stat().st_mtime_ns, path.stat().st_ino
    online_record(scenario, path)
    return (path.stat().st_mtime_ns, path.stat().st_ino) != before


def test_the_same_scenario_reuses_its_record(kept: Path) -> None:
    assert not is_made_again(quick_scenario(), kept)
    assert not is_made_again(Scenario.load("bluerov2-heavy", QUICK[::-1]), kept)


@pytest.mark.parametrize(
    "override",
    [
        *("simulation.duration=1.9", "samples.seed=2", "learner.period=0.2", "game.gamma=2.5"),
        *("simulation.chi=3", "learner.leash=0.01", "vehicle=bluerov2-heavy-buoyant"),
    ],
)
def test_other_settings_have_another_key(override: str) -> None:
    assert key(Scenario.load("bluerov2-heavy", [*QUICK, override])) != key(quick_scenario())


def test_other_settings_make_it_again(kept: Path) -> None:
    assert is_made_again(quick_scenario("simulation.duration=0.5"), kept)
    assert load(kept)["time"].values[-1] == pytest.approx(0.5)


def test_another_policy_makes_it_again(kept: Path) -> None:
    scenario = quick_scenario()
    station = scenario.station_keeping()
    before = load(kept).attrs["key"]
    linear = online_record(scenario, kept, policy=lambda: linear_on(station), kind="linear")
    assert linear.attrs["key"] != before
    assert linear.sizes["learn_time"] == 0


def test_an_edited_vehicle_has_another_key(tmp_path: Path) -> None:
    source = (
        Path(__file__).resolve().parents[1]
        / "symbolic"
        / "underwater"
        / "vehicles"
        / "bluerov2-heavy.toml"
    )
    vehicle = tmp_path / "mine.toml"
    shutil.copy(source, vehicle)
    settings = [*QUICK, f"vehicle='{vehicle}'"]
    before = key(Scenario.load("bluerov2-heavy", settings))
    assert key(Scenario.load("bluerov2-heavy", settings)) == before
    text = source.read_text(encoding="utf-8")
    vehicle.write_text(text.replace("mass = 13.5 ", "mass = 14.5 "), encoding="utf-8")
    assert key(Scenario.load("bluerov2-heavy", settings)) != before


def test_an_edited_basis_has_another_key(tmp_path: Path) -> None:
    basis = tmp_path / "basis.py"
    settings = [*QUICK, f"basis.name='{basis}:more'"]
    basis.write_text(BASIS.format(power="x[0] ** 4"), encoding="utf-8")
    before = key(Scenario.load("bluerov2-heavy", settings))
    assert key(Scenario.load("bluerov2-heavy", settings)) == before
    basis.write_text(BASIS.format(power="x[1] ** 4"), encoding="utf-8")
    assert key(Scenario.load("bluerov2-heavy", settings)) != before


def test_other_weights_under_the_same_name_make_it_again(kept: Path, tmp_path: Path) -> None:
    """The run starts from the numbers in the file, so its name is not enough."""
    scenario = quick_scenario(f"learner.weights='{kept}'", "simulation.duration=0.3")
    path = tmp_path / "continued.nc"
    online_record(scenario, path)
    assert not is_made_again(scenario, path)
    online_record(quick_scenario("samples.seed=5"), kept)
    assert is_made_again(scenario, path)
    start = load(kept)["critic"].values[-1]
    np.testing.assert_array_equal(load(path)["critic"].values[0], start)


def test_the_optimum_does_not_depend_on_the_learner() -> None:
    scenario = quick_scenario()
    before = key(scenario, OFFLINE_KEY)
    other = scenario.with_settings(learner={"rule": "gradient"}, samples={"number": 3})
    assert key(other, OFFLINE_KEY) == before
    assert key(other) != key(scenario)
    basis = scenario.with_settings(basis={"name": "drag"})
    assert key(basis, OFFLINE_KEY) == before
    assert key(basis, OFFLINE_KEY | {"basis"}) != key(scenario, OFFLINE_KEY | {"basis"})
    assert key(scenario.with_settings(offline={"intervals": 9}), OFFLINE_KEY) != before


def test_the_optimum_is_kept_for_its_state(tmp_path: Path) -> None:
    path = tmp_path / "optimal.nc"
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, *ROUGH])
    solver = OfflineSolver(scenario.station_keeping().problem, scenario.offline)
    first = optimal_record(scenario, solver, path)
    before = path.stat().st_mtime_ns
    xr.testing.assert_identical(first, optimal_record(scenario, solver, path))
    assert path.stat().st_mtime_ns == before
    optimal_record(scenario, solver, path, 0.5 * scenario.initial_state)
    assert path.stat().st_mtime_ns != before


def test_the_same_seed_gives_the_same_numbers(kept: Path) -> None:
    again = online_record(quick_scenario())
    xr.testing.assert_identical(load(kept).drop_attrs(), again.drop_attrs())


def test_provenance(kept: Path) -> None:
    attributes = load(kept).attrs
    copy = Scenario.model_validate_json(attributes["scenario"])
    assert copy.model_dump() == quick_scenario().model_dump()
    assert attributes["seed"] == 1
    assert attributes["kind"] == "learned"
    assert attributes["wall_seconds"] > 0.0
    for name in ("stationkeep", "casadi", "numpy", "scipy"):
        assert attributes[f"{name}_version"][0].isdigit()
    assert len(attributes["functions"]) == 64, "the hash of the compiled functions"
    assert '"mass":13.5' in attributes["vehicle"]
