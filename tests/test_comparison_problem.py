"""Scenarios of problems that are no vehicle: loaded, run, swept, replayed without their file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario, replay, sweep
from stationkeep.comparison.policies import available, contender
from stationkeep.comparison.records import online_record
from stationkeep.online import load
from stationkeep.symbolic import InputError, StationKeeping

FILE = """
import numpy as np
from stationkeep.symbolic.textbook import double_integrators, quadrotor

problem = quadrotor()
number = 7


def six():
    return double_integrators(6)


def broken():
    raise ValueError("no such plant")


def gain(setup):
    K = setup.problem.linear_gains[0]
    return lambda zeta: -K @ zeta


def nothing(setup):
    return 3
"""
Check = Callable[[BaseException], str]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "plants.py"
    path.write_text(FILE, encoding="utf-8")
    return path


def test_a_problem_or_a_function_that_makes_one(file: Path) -> None:
    one, six = (Scenario.load(f"{file}:{name}") for name in ("problem", "six"))
    assert one.setup().problem.name == "planar quadrotor"
    assert six.setup().problem.n_states == 12
    assert not isinstance(six.setup(), StationKeeping)
    assert {"learned", "linear", "lqr", "mpc"} <= set(available(six.setup()))
    assert "pid" not in available(six.setup())
    assert "mpc" not in available(one.setup())  # it needs inverse dynamics


@pytest.mark.slow
def test_no_state_is_a_pitch(file: Path) -> None:
    """Six double integrators at q_5 = 2 m: beyond 90 degrees, were it a vehicle's pitch."""
    state = "simulation.initial_state=[0,0,0,0,2,0,0,0,0,0,0,0]"
    six = Scenario.load(f"{file}:six", [state, "simulation.duration=0.3", "samples.number=50"])
    record = online_record(six)
    assert record.attrs["stopped"] == ""
    assert record["zeta"].values[0][4] == 2.0


def test_times_follow_the_problem(file: Path) -> None:
    """Ten times as fast a chain has a tenth of the times and ten times the gains."""
    file.write_text(
        f"{FILE}\n\ndef slow():\n    return double_integrators(2)\n\n\ndef fast():\n"
        "    return double_integrators(2, velocity_weight=0.01, input_weight=1e-4)\n",
        encoding="utf-8",
    )
    fast, slow = (Scenario.load(f"{file}:{name}") for name in ("fast", "slow"))
    ratio = fast.setup().problem.decay_rate / slow.setup().problem.decay_rate
    assert ratio == pytest.approx(10.0, rel=1e-9)
    for group, key, power in (
        *(("learner", "horizon", -1), ("learner", "period", -1), ("learner", "gain_actor_1", 1)),
        *(("simulation", "control_period", -1), ("simulation", "duration", -1)),
    ):
        values = [getattr(getattr(one, group), key) for one in (fast, slow)]
        assert values[0] / values[1] == pytest.approx(10.0**power, rel=0.1), key


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("simulation.plant='rexrov'", ("simulation.plant", "for a vehicle")),
        ("current=[1,0,0]", ("current", "for a vehicle")),
        ("simulation.mode=disturbed", ("disturbed", "for a vehicle")),
        ("game.Q=[1,1]", ("game.Q", "for a vehicle")),
        ("vehicle='rexrov'", ("both 'vehicle' and 'problem'",)),
        ("game.gamma=0.5", ("gamma", "too small")),
        ("envelope.half_widths=[1,1]", ("6 states",)),
        ("simulation.initial_state=[0,0]", ("6 numbers",)),
        ("simulation.initial_state=[0,0,2,0,0,0]", ("must stay inside",)),
        ("basis.name=drag-cubic", ("translations, angles",)),
    ],
)
def test_what_does_not_suit_a_problem_is_refused(
    file: Path, override: str, words: tuple[str, ...], one_sentence: Check
) -> None:
    with pytest.raises(InputError) as caught:
        Scenario.load(f"{file}:problem", [override]).setup()
    text = one_sentence(caught.value)
    assert all(word in text for word in words), text


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("missing", ("no function 'missing'",)),
        ("number", ("is a int", "Problem")),
        ("broken", ("raises ValueError: no such plant",)),
    ],
)
def test_what_is_no_problem(file: Path, name: str, words: tuple[str, ...], one_sentence: Check) -> None:
    with pytest.raises(InputError) as caught:
        Scenario.load(f"{file}:{name}")
    text = one_sentence(caught.value)
    assert all(word in text for word in words), text


def test_a_vehicle_is_asked_for_by_name(file: Path, one_sentence: Check) -> None:
    with pytest.raises(InputError, match="needs a vehicle") as caught:
        Scenario.load(f"{file}:six").station_keeping()
    one_sentence(caught.value)


def test_a_record_needs_no_file(file: Path, tmp_path: Path) -> None:
    """The record holds the equations: the run is bit-equal when its file is gone."""
    short = ["simulation.duration=0.2", "samples.number=50", "learner.steps=50"]
    path = tmp_path / "learned.nc"
    online_record(Scenario.load(f"{file}:problem", short), path)
    assert "tau_b" not in load(path)
    file.unlink()
    answer = replay(path)
    assert answer.verdict == "bit-equal"
    assert answer.changed == []


def test_ones_own_policy_in_a_sweep(file: Path, tmp_path: Path) -> None:
    """A file's -K ζ is the linear policy: the same figures; another content is another run."""
    scenario = Scenario.load(f"{file}:problem", ["simulation.duration=0.5"])
    own = tmp_path / "policy.py"
    own.write_text(FILE, encoding="utf-8")
    mine = f"{own}:gain"
    found = sweep(scenario, tmp_path / "s", policies=["linear", mine], states=2, workers=1)
    assert (found.runs, found.failed, found.resumed) == (4, 0, 0)
    rows = {group["policy"]: group["regret"]["median"] for group in found.summary}
    assert rows[mine] == pytest.approx(rows["linear"], rel=1e-9)
    own.write_text(FILE.replace("-K", "-0.9 * K"), encoding="utf-8")
    again = sweep(scenario, tmp_path / "s", policies=["linear", mine], states=2, workers=1)
    assert again.resumed == 2


def test_a_policy_that_is_none(file: Path, one_sentence: Check) -> None:
    scenario = Scenario.load(f"{file}:problem")
    with pytest.raises(InputError, match="must return a function of the state") as caught:
        contender(f"{file}:nothing").make(scenario)
    one_sentence(caught.value)
    with pytest.raises(InputError, match="no function 'absent'"):
        contender(f"{file}:absent")


def test_the_default_start_is_half_of_the_envelope(file: Path) -> None:
    scenario = Scenario.load(f"{file}:problem", ["envelope.scale=0.4"])
    problem = scenario.setup().problem
    np.testing.assert_allclose(scenario.initial_state, 0.2 * problem.scale)
