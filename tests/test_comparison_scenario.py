"""Scenarios: --set, copies with other settings, files beside the scenario, trim, learned weights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.comparison.records import online_record
from stationkeep.online import LearnerSettings, SampleSettings, run, save
from stationkeep.symbolic import InputError, Vehicle

from .commands import QUICK
from .games import quick_scenario

SHIPPED = (
    Path(__file__).resolve().parents[1]
    / "comparison"
    / "scenario"
    / "scenarios"
    / "bluerov2-heavy.toml"
)
VEHICLES = Path(__file__).resolve().parents[1] / "symbolic" / "underwater" / "vehicles"
BASIS = """
import casadi
from stationkeep.symbolic import quadratic

def more(x):
    return casadi.vertcat(quadratic(x), {power})
"""


def write_scenario(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the shipped scenario with some text replaced into `folder`."""
    text = SHIPPED.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    folder.mkdir(exist_ok=True)
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("override", "group", "key", "value"),
    [
        ("game.gamma=3", "game", "gamma", 3.0),
        ("game.gamma = 3.5 ", "game", "gamma", 3.5),
        ("game.gamma=1e3", "game", "gamma", 1000.0),
        ("samples.number=7", "samples", "number", 7),
        ("simulation.mode='disturbed'", "simulation", "mode", "disturbed"),
        ('simulation.mode="disturbed"', "simulation", "mode", "disturbed"),
        ("simulation.mode=disturbed", "simulation", "mode", "disturbed"),
        ("simulation.mode = disturbed ", "simulation", "mode", "disturbed"),
        ("basis.name=drag-cubic", "basis", "name", "drag-cubic"),
        ("basis.name=../my basis.py:f", "basis", "name", "../my basis.py:f"),
        ("learner.weights=a=b.nc", "learner", "weights", "a=b.nc"),
        ("offline.aligned=false", "offline", "aligned", False),
        ("game.R=[1, 2, 3, 4, 5, 6.5]", "game", "R", [1, 2, 3, 4, 5, 6.5]),
        ("game.W_d=R", "game", "W_d", "R"),
    ],
)
def test_overrides(override: str, group: str, key: str, value: object) -> None:
    scenario = Scenario.load("bluerov2-heavy", [override])
    assert getattr(getattr(scenario, group), key) == value
    assert Scenario.load("bluerov2-heavy").game.gamma == 2.0


def test_overrides_of_deep_and_top_keys() -> None:
    overrides = ["simulation.disturbance.kind=current", "simulation.disturbance.velocity=[0.1, 0, 0]"]
    overrides.append("simulation.mode=disturbed")
    scenario = Scenario.load("bluerov2-heavy", [*overrides, "current=[0, 0.2, 0]", "vehicle=rexrov"])
    assert scenario.simulation.disturbance.kind == "current"
    assert scenario.simulation.disturbance.velocity == (0.1, 0.0, 0.0)
    assert scenario.current == (0.0, 0.2, 0.0)
    assert scenario.vehicle == "rexrov"


def test_the_last_override_counts() -> None:
    scenario = Scenario.load("bluerov2-heavy", ["game.gamma=3", "game.gamma=4"])
    assert scenario.game.gamma == 4.0


def test_with_settings_changes_a_copy() -> None:
    scenario = quick_scenario()
    other = scenario.with_settings(samples={"number": 5}, learner={"rule": "gradient"})
    assert other.samples.number == 5
    assert other.samples.seed == scenario.samples.seed
    assert other.learner.rule == "gradient"
    assert scenario.samples.number == 200
    assert other.station_keeping() is scenario.station_keeping(), "compiled once for both"
    basis = scenario.with_settings(basis={"name": "quadratic"})
    assert basis.station_keeping() is not scenario.station_keeping()
    with pytest.raises(InputError, match=r"samples\.number"):
        scenario.with_settings(samples={"number": -1})


def test_settings_are_immutable() -> None:
    with pytest.raises(ValueError, match="frozen"):
        quick_scenario().samples.number = 3  # type: ignore[misc]


@pytest.mark.parametrize("name", Scenario.shipped())
def test_what_is_shipped_learns_with_the_defaults(name: str) -> None:
    """A scenario file holds what differs."""
    scenario = Scenario.load(name)
    assert scenario.learner == LearnerSettings()
    assert scenario.samples == SampleSettings()


def test_files_beside_the_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle, the basis and the weights are found from any working folder."""
    folder = tmp_path / "mine"
    changes = (
        ('vehicle = "bluerov2-heavy"', 'vehicle = "heavy.toml"'),
        ('name = "drag" ', 'name = "basis.py:more" '),
        ("[simulation]", "[learner]\nweights = 'first.nc'\n\n[simulation]"),
    )
    path = write_scenario(folder, *changes)
    vehicle = (VEHICLES / "bluerov2-heavy.toml").read_text(encoding="utf-8")
    (folder / "heavy.toml").write_text(vehicle.replace("BlueROV2 Heavy, neutral", "mine"), "utf-8")
    (folder / "basis.py").write_text(BASIS.format(power="x[0] ** 4"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    scenario = Scenario.load("mine/mine.toml", ["samples.number=0", "simulation.duration=0.1"])
    station = scenario.station_keeping()
    assert station.model.vehicle.name == "mine"
    assert station.basis.n_basis == 79
    with pytest.raises(InputError, match=r"first\.nc"):
        scenario.initial_weights()
    start = scenario.with_settings(learner={"weights": "riccati"})
    save(online_record(start), folder / "first.nc")
    weights = scenario.initial_weights()
    assert weights is not None
    assert weights.shape == (79,)
    assert Scenario.load(path).vehicle == "heavy.toml"


def test_one_sided_disturbance_weights() -> None:
    same = Scenario.load("bluerov2-heavy").station_keeping().game
    np.testing.assert_array_equal(same.W_d, np.diag([1.0, 1, 1, 10, 10, 10]))
    np.testing.assert_array_equal(same.W_d, same.R)


def test_the_papers_disturbance_weight_is_the_default(tmp_path: Path) -> None:
    path = write_scenario(tmp_path / "mine", ('W_d = "R" ', "# "), ("gamma = 2.0", "gamma = 4.0"))
    np.testing.assert_array_equal(Scenario.load(path).station_keeping().game.W_d, np.eye(6))


@pytest.mark.parametrize("speed", [0.3, -0.2])
def test_trim_in_a_known_current_along_x(speed: float) -> None:
    """At rest in water that moves along x the drag D(v) v pushes, and the trim pushes back."""
    scenario = quick_scenario(f"current=[{speed}, 0, 0]")
    station = scenario.station_keeping()
    drag = 13.7 * speed + 141.0 * abs(speed) * speed  # N, the published surge damping
    np.testing.assert_allclose(station.model.u_trim, [-drag, 0, 0, 0, 0, 0], atol=1e-9)
    held = station.model.drift(np.zeros(12)) + station.model.input_matrix(np.zeros(12)) @ (
        station.model.u_trim
    )
    np.testing.assert_allclose(held, 0.0, atol=1e-12)
    terms = station.functions.at(np.zeros((1, 12)))
    np.testing.assert_allclose(terms.f, 0.0, atol=1e-12)


def test_trim_of_a_vehicle_that_is_not_neutral() -> None:
    """It weighs 132.57 N and displaces 131.59 N: 0.98 N upwards, z down, hold it."""
    vehicle = Vehicle.load("bluerov2-heavy-buoyant")
    station = quick_scenario("vehicle=bluerov2-heavy-buoyant").station_keeping()
    expected = [0, 0, vehicle.buoyancy - vehicle.weight, 0, 0, 0]
    np.testing.assert_allclose(station.model.u_trim, expected, atol=1e-9)
    assert expected[2] == pytest.approx(-0.98)


@pytest.mark.slow
@pytest.mark.parametrize("overrides", [("vehicle=bluerov2-heavy-buoyant",), ("current=[0.2, 0.1, 0]",)])
def test_trimmed_scenarios_stay_at_their_station(overrides: tuple[str, ...]) -> None:
    """From the station itself nothing moves: the trim is applied, and is no part of u_1."""
    state = "simulation.initial_state=[0,0,0,0,0,0,0,0,0,0,0,0]"
    scenario = quick_scenario(*overrides, state, "simulation.duration=0.5")
    history = run(scenario)
    assert history.stopped is None
    np.testing.assert_allclose(history.zeta, 0.0, atol=1e-9)
    np.testing.assert_allclose(history.u_control, 0.0, atol=1e-7)
    trim = scenario.station_keeping().model.u_trim
    assert np.abs(trim).max() > 0.9
    np.testing.assert_allclose(history.tau_b[0], trim, atol=1e-9)


def test_weights_of_a_record_continue_the_learning(tmp_path: Path) -> None:
    first = online_record(quick_scenario(), tmp_path / "first.nc")
    name = f"learner.weights='{tmp_path / 'first.nc'}'"
    second = online_record(quick_scenario(name, "simulation.duration=0.3"))
    np.testing.assert_array_equal(second["critic"].values[0], first["critic"].values[-1])
    np.testing.assert_array_equal(second["actor_1"].values[0], first["critic"].values[-1])
    riccati = quick_scenario().station_keeping().riccati_weights
    moved = np.linalg.norm(second["critic"].values[0] - riccati) / np.linalg.norm(riccati)
    assert moved > 0.05, "the first run must have learned something for this to show anything"
    half = quick_scenario(name, "learner.weight_factor=0.5").initial_weights()
    np.testing.assert_allclose(half, 0.5 * first["critic"].values[-1])


def test_names_of_shipped_scenarios() -> None:
    assert Scenario.shipped() == sorted(Scenario.shipped())
    for name in Scenario.shipped():
        assert Scenario.load(name).game.W_d == "R"
    assert QUICK[0] == "basis.name=quadratic"
