"""A trim that the thrusters can't give is shown by the check and refused at a run; so is a heading in
degrees."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from stationkeep import Controller, Scenario, check, sweep
from stationkeep.comparison.records import closed_loop
from stationkeep.comparison.theory.vehicle_conditions import trim_condition
from stationkeep.symbolic import InputError, Vehicle

SHIPPED = Path(str(resources.files("stationkeep.comparison.scenario"))) / "scenarios"
Check = Callable[[BaseException], str]


@pytest.mark.parametrize(
    ("override", "share", "words"),
    [
        ("vehicle_parameters.buoyancy=500", 2.30, ["367.4", "2.3 times"]),
        ("current=[3,0,0]", 10.1, ["-1310.1", "10 times"]),
    ],
)
def test_a_trim_beyond_the_thrusters(
    override: str, share: float, words: list[str], one_sentence: Check
) -> None:
    scenario = Scenario.load(overrides=[override, "samples.number=20"])
    (row,) = trim_condition(scenario.station_keeping())
    assert row.value == pytest.approx(share, rel=0.01)
    assert not row.holds
    for use in (closed_loop, Controller):
        with pytest.raises(InputError) as caught:
            use(scenario)
        text = one_sentence(caught.value)
        assert all(word in text for word in words), text


def test_check_has_a_row_of_the_trim() -> None:
    names = {row.name: row for row in check(Scenario.load(overrides=["basis.name=quadratic"]))}
    assert names["the thrusters can hold the trim"].value == 0.0


def test_a_setting_of_a_sweep_that_cannot_be_held_is_a_row(tmp_path: Path) -> None:
    sets = ["simulation.duration=0.2", "samples.number=20", "basis.name=quadratic"]
    vary = ["vehicle.buoyancy=132.4,500"]
    swept = sweep(
        Scenario.load(overrides=sets), tmp_path, policies=["linear"], vary=vary, workers=1, states=0
    )
    assert (swept.runs, swept.failed) == (2, 1)
    assert "times what its thrusters can give" in swept.csv.read_text(encoding="utf-8")


def test_the_least_share_is_that_of_known_layouts() -> None:
    """Heave by four verticals with arms alone: a quarter of the force over the limit of its sign."""
    thrusters = Vehicle.load("bluerov2-heavy").thrusters
    assert thrusters is not None
    reverse, forward = thrusters.limits
    heave = np.zeros(6)
    verticals = np.abs(thrusters.matrix[2]) > 0.5
    assert verticals.sum() == 4
    for force in (100.0, -100.0):
        heave[2] = force
        sign = np.sign(thrusters.matrix[2, verticals][0]) * force
        limit = forward if sign > 0.0 else -reverse
        assert thrusters.least_share(heave) == pytest.approx(100.0 / 4.0 / limit, rel=1e-6)
    assert thrusters.least_share(np.zeros(6)) == pytest.approx(0.0, abs=1e-12)


def test_a_heading_in_degrees_is_named(one_sentence: Check) -> None:
    scenario = Scenario.load(overrides=["samples.number=20"])
    with pytest.raises(InputError, match="angles are in rad") as caught:
        Controller(scenario, station=(0.0, 0.0, 5.0, 90.0))
    assert "90 rad" in one_sentence(caught.value)
    Controller(scenario, station=(0.0, 0.0, 5.0, -2.0 * np.pi))


def test_a_disturbance_of_the_game_is_refused(one_sentence: Check) -> None:
    sets = ["simulation.disturbance.kind=current", "simulation.disturbance.velocity=[0.5,0,0]"]
    with pytest.raises(InputError, match="second player") as caught:
        Scenario.load(overrides=sets)
    assert "disturbed" in one_sentence(caught.value)


DISTURBED = "simulation.mode=disturbed"
CURRENT = "simulation.disturbance.kind=current"
WAVE = "simulation.disturbance.wave_height=1"


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ([WAVE], "kind = 'none' has no use for it"),
        ([DISTURBED, CURRENT, WAVE], "kind = 'current' has no use for it"),
        (["learner.rule=gradient", "learner.forgetting=1"], "'learner.forgetting'"),
        (["learner.normalizer=paper"], "error = 'costate'"),
    ],
)
def test_a_key_that_the_choice_has_no_use_for(
    overrides: list[str], words: str, one_sentence: Check
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        Scenario.load(overrides=overrides)
    assert "leave it out" in one_sentence(caught.value)


def test_keys_of_another_choice_that_may_stay(tmp_path: Path) -> None:
    """Where a command chooses another kind than the file, the file's keys stay as they are."""
    text = (SHIPPED / "bluerov2-heavy.toml").read_text(encoding="utf-8")
    text = text.replace('mode = "game"', 'mode = "disturbed"')
    lines = "[simulation.disturbance]\nkind = 'current'\nvelocity = [0.1, 0, 0]\n"
    file = tmp_path / "current.toml"
    file.write_text(text + lines)
    assert Scenario.load(file).simulation.disturbance.kind == "current"
    other = "simulation.disturbance.kind=waves"
    assert Scenario.load(file, [other, WAVE]).simulation.disturbance.wave_height == 1.0
    file.write_text(file.read_text(encoding="utf-8") + "wave_height = 1\n")
    with pytest.raises(InputError, match="wave_height"):
        Scenario.load(file)
    Scenario.load(file, varied=[other])
