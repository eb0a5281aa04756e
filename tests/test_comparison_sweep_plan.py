"""The plan of a sweep: products, samplers, keys, and vehicles with other parameters."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import qmc
from stationkeep.comparison import Scenario
from stationkeep.comparison.sweep import Plan, parse_vary
from stationkeep.comparison.sweep.sweep_plan import sampled
from stationkeep.comparison.sweep.vary import Choices, Range, varied
from stationkeep.online import draw_samples
from stationkeep.symbolic import InputError, Vehicle

from .games import HALF_WIDTHS

SCENARIO = Scenario.load()
GAMMA = Choices("game.gamma", (1.5, 2.0, 3.0))
FRAME = Range("vehicle.added_mass.factor", 0.5, 1.5)


def test_every_combination_once_with_the_policy_fastest() -> None:
    scales = Choices("envelope.scale", (0.1, 1.0))
    plan = Plan(SCENARIO, ("learned", "linear"), (scales, GAMMA, FRAME), 4, states=5, seed=3)
    runs = [plan.run(number) for number in range(len(plan))]
    assert len(runs) == 2 * 3 * 4 * 5 * 2
    assert len({run.key for run in runs}) == len(runs)
    assert [run.number for run in runs] == list(range(len(runs)))
    assert [run.policy for run in runs[:3]] == ["learned", "linear", "learned"]
    assert [run.state for run in runs[:11]] == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 0]
    assert [run.settings["game.gamma"] for run in runs[::40]] == [1.5, 2.0, 3.0] * 2
    factors = {run.settings[FRAME.key] for run in runs}
    assert len(factors) == 4
    assert all(0.5 <= factor < 1.5 for factor in factors)
    for scale in (0.1, 1.0):
        drawn = draw_samples(scale * HALF_WIDTHS, 5, 3)
        here = [run.zeta for run in runs if run.settings["envelope.scale"] == scale]
        np.testing.assert_array_equal(here[:10:2], drawn)
        assert here[:10] == here[10:20], "every setting and policy gets the same states"


def test_samplers_fill_the_cube_as_they_promise() -> None:
    latin = sampled(20, 3, "latin", 1)
    for column in latin.T:  # one point in each of N strata
        assert sorted((20 * column).astype(int)) == list(range(20))
    sobol = sampled(64, 3, "sobol", 1)
    for column in sobol.T:  # a power of two of them is a (0, m, 1)-net in every direction
        assert sorted((64 * column).astype(int)) == list(range(64))
    np.testing.assert_array_equal(sampled(50, 3, "sobol", 1), sobol[:50])
    plain = sampled(64, 3, "random", 1)
    assert qmc.discrepancy(sobol) < 0.5 * qmc.discrepancy(plain)
    for kind in ("random", "latin", "sobol"):
        one, again, other = (sampled(7, 2, kind, seed) for seed in (4, 4, 5))  # type: ignore[arg-type]
        assert one.shape == (7, 2)
        assert np.all((one >= 0.0) & (one < 1.0))
        np.testing.assert_array_equal(one, again)
        assert not np.any(one == other)


def test_ranges() -> None:
    (log,) = parse_vary(["game.gamma=1.2:120:log"], SCENARIO)
    assert isinstance(log, Range)
    assert log.at(0.0) == pytest.approx(1.2)
    assert log.at(0.5) == pytest.approx(12.0)
    (count,) = parse_vary(["samples.seed=1:4"], SCENARIO)
    assert isinstance(count, Range)
    found = [count.at(unit) for unit in np.arange(400) / 400]
    assert [found.count(value) for value in (1, 2, 3, 4)] == [100] * 4
    assert all(isinstance(value, int) for value in found)
    (negative,) = parse_vary(["simulation.initial_state[0]=-0.5:.5"], SCENARIO)
    assert isinstance(negative, Range)
    assert (negative.low, negative.high) == (-0.5, 0.5)


def test_values_are_read_as_in_toml_or_as_words() -> None:
    (words,) = parse_vary(["basis.name=quadratic,drag"], SCENARIO)
    assert words == Choices("basis.name", ("quadratic", "drag"))
    (arrays,) = parse_vary(["current=[0.1,0,0],[0.2,0,0]"], SCENARIO)
    assert arrays == Choices("current", ([0.1, 0, 0], [0.2, 0, 0]))
    (truths,) = parse_vary(["learner.safeguard=true,false"], SCENARIO)
    assert truths == Choices("learner.safeguard", (True, False))


def test_settings_that_only_go_together() -> None:
    """A disturbance belongs to one mode: neither key can be varied by itself."""
    kinds, modes = "simulation.disturbance.kind=current,waves", "simulation.mode=disturbed"
    for texts in ([kinds, modes], [modes, kinds]):
        assert {one.key for one in parse_vary(texts, SCENARIO)} == {
            "simulation.disturbance.kind",
            "simulation.mode",
        }
    with pytest.raises(InputError, match="second player's"):
        parse_vary([kinds], SCENARIO)
    with pytest.raises(InputError, match="did you mean 'gamma'"):
        parse_vary([modes, "game.gama=2,3"], SCENARIO)


def test_keys_say_what_the_numbers_depend_on() -> None:
    """A longer sweep finds what a shorter one made; another scenario finds nothing."""
    short = Plan(SCENARIO, ("linear",), (GAMMA,), states=3)
    more = Plan(
        SCENARIO, ("learned", "linear"), (Choices("game.gamma", (1.5, 2.0, 3.0, 5.0)),), states=3
    )
    keys = {more.run(number).key for number in range(len(more))}
    assert {short.run(number).key for number in range(len(short))} <= keys
    other = SCENARIO.with_settings(simulation={"duration": 30.0})
    for plan in (
        Plan(other, ("linear",), (GAMMA,), states=3),
        Plan(SCENARIO, ("linear",), (GAMMA,), states=3, seed=2),
        Plan(SCENARIO, ("linear",), (GAMMA,), states=3, kept="other records"),
    ):
        assert not {plan.run(number).key for number in range(len(plan))} & keys


def test_keys_depend_on_the_vehicles_file(tmp_path: object) -> None:
    folder = tmp_path
    file = folder / "mine.toml"  # type: ignore[operator]

    def key(mass: float) -> str:
        vehicle = Vehicle.load("bluerov2-heavy").model_dump(mode="json") | {"mass": mass}
        thrusters = vehicle.pop("thrusters")
        lines = [f"{name} = {json.dumps(value)}" for name, value in vehicle.items()]
        lines += ["[thrusters]", *(f"{name} = {json.dumps(v)}" for name, v in thrusters.items())]
        file.write_text("\n".join(lines), encoding="utf-8")
        return Plan(SCENARIO, ("linear",), (Choices("vehicle", (str(file),)),)).run(0).key

    assert key(13.5) == key(13.5)
    assert key(13.5) != key(14.0)


def test_vehicle_parameters_are_replaced_and_multiplied() -> None:
    before = SCENARIO.model_vehicle()
    one = varied(SCENARIO, {"vehicle.mass": 15.0, "vehicle.added_mass.factor": 2.0})
    assert one.model_vehicle().mass == 15.0
    np.testing.assert_allclose(one.model_vehicle().M_added, 2.0 * before.M_added)
    np.testing.assert_allclose(one.station_keeping().model.vehicle.M_added, 2.0 * before.M_added)
    assert one.plant_vehicle() is None, "what is driven is what is modelled"
    entry = varied(SCENARIO, {"vehicle.added_mass[2][2]": 30.0}).model_vehicle()
    assert entry.M_added[2, 2] == 30.0
    np.testing.assert_array_equal(np.delete(entry.M_added, 2, 0), np.delete(before.M_added, 2, 0))
    assert SCENARIO.model_vehicle() == before


def test_the_plant_alone() -> None:
    one = varied(SCENARIO, {"vehicle.mass": 15.0, "plant.quadratic_damping.factor": 0.5})
    driven, model = one.plant_vehicle(), one.model_vehicle()
    assert driven is not None
    np.testing.assert_allclose(driven.D_quadratic, 0.5 * model.D_quadratic)
    assert driven.mass == model.mass == 15.0
    named = SCENARIO.with_settings(simulation={"plant": "bluerov2-heavy-2024"})
    driven = varied(named, {"plant.mass.factor": 1.1}).plant_vehicle()
    assert driven is not None
    assert driven.mass == pytest.approx(1.1 * Vehicle.load("bluerov2-heavy-2024").mass)


def test_a_scenario_of_another_vehicle_is_another_station() -> None:
    one = SCENARIO.with_settings(vehicle_parameters={"mass": 15.0})
    assert one.station_keeping() is not SCENARIO.station_keeping()
    assert one.setup_text() != SCENARIO.setup_text()
    kept = SCENARIO.with_settings(learner={"leash": 0.1})
    assert kept.station_keeping() is SCENARIO.station_keeping()
    assert Scenario.load(overrides=["vehicle_parameters.mass=15"]).model_vehicle().mass == 15.0


BAD = [
    ("game.gama=1,2", "did you mean 'gamma'"),
    ("game.gamma=2,-1", "greater than 0"),
    ("game.gamma=3:2", "smaller to a larger"),
    ("game.gamma=0:2:log", "above zero"),
    ("game.gamma", "section.key="),
    ("game.gamma=", "section.key="),
    ("game.gamma=2,2", "twice"),
    ("samples.seed=1.5:4", "integer"),
    ("simulation.initial_state[12]=0,1", "0 to 11"),
    ("game.gamma[0]=1,2", "no entries"),
    ("vehicle.mass=-1,2", "mass"),
    ("vehicle.maas=1,2", "did you mean 'mass'"),
    ("vehicle.name.factor=1,2", "no number or array"),
    ("plant.mass=0:1", "mass"),
    ("basis.name.kind=a,b", "is a value"),
    ("a b=1,2", "no key"),
]


@pytest.mark.parametrize(("text", "words"), BAD)
def test_bad_settings(text: str, words: str, one_sentence: Callable[[BaseException], str]) -> None:
    with pytest.raises(InputError) as caught:
        parse_vary([text], SCENARIO)
    assert words in one_sentence(caught.value)


def test_bad_plans(one_sentence: Callable[[BaseException], str]) -> None:
    state = Choices("simulation.initial_state[0]", (0.1, 0.2))
    for words, plan in {
        "--samples": lambda: Plan(SCENARIO, ("linear",), (FRAME,)),
        "both or neither": lambda: Plan(SCENARIO, ("linear",), (GAMMA,), 5),
        "varied twice": lambda: Plan(SCENARIO, ("linear",), (GAMMA, GAMMA)),
        "named twice": lambda: Plan(SCENARIO, ("linear", "linear")),
        "did you mean 'linear'": lambda: Plan(SCENARIO, ("liner",)),
        "choose one": lambda: Plan(SCENARIO, ("linear",), (state,), states=4),
    }.items():
        with pytest.raises(InputError) as caught:
            plan()
        assert words in one_sentence(caught.value)
