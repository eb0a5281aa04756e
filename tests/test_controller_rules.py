"""What a controller refuses, limits and flags: gaps, teleports, far stations, absurd rates."""

from __future__ import annotations

import contextlib
import logging
import re
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stationkeep.comparison.policies import LinearPolicy, OnVehicle
from stationkeep.comparison.policies.pid import CascadedPID
from stationkeep.online import Controller
from stationkeep.symbolic import InputError, RunError
from stationkeep.symbolic.game import longest_hold
from stationkeep.symbolic.textbook import double_integrators

from .games import HALF_WIDTHS, Array, quick_scenario

ETA = np.array([0.4, -0.2, 0.3, 0.08, -0.05, 0.2])
ETA_DOT = np.array([0.05, -0.02, 0.03, 0.02, -0.04, 0.06])
STILL = np.zeros(6)
CHI = 4.0  # half-widths, as predictions and simulated runs have it
CASE = Path(__file__).parent / "cases" / "03-controller-roll-pitch.py"


def frozen() -> Controller:
    return Controller(quick_scenario(), learn=False)


def on_vehicle() -> OnVehicle:
    station = quick_scenario().station_keeping()
    return OnVehicle(CascadedPID(station), station)


MAKERS: dict[str, Callable[[], Controller | OnVehicle]] = {
    "learning": lambda: Controller(quick_scenario()),
    "frozen": frozen,
    "pid": on_vehicle,
}

WRONG: dict[str, tuple[object, object, object]] = {
    "dt as text": (ETA, ETA_DOT, "0.02"),
    "dt missing": (ETA, ETA_DOT, None),
    "dt as a list": (ETA, ETA_DOT, [0.02]),
    "dt true": (ETA, ETA_DOT, True),
    "dt complex": (ETA, ETA_DOT, 0.02 + 0j),
    "dt NaN": (ETA, ETA_DOT, np.float64("nan")),
    "dt zero": (ETA, ETA_DOT, 0),
    "dt negative": (ETA, ETA_DOT, -1e-3),
    "dt infinite": (ETA, ETA_DOT, np.inf),
    "a pose of text": (["0.1"] * 6, ETA_DOT, 0.02),
    "a pose of truth values": ([True] * 6, ETA_DOT, 0.02),
    "a complex pose": (ETA + 0j, ETA_DOT, 0.02),
    "no pose": (None, ETA_DOT, 0.02),
    "no rates": (ETA, None, 0.02),
    "a number": (1.0, ETA_DOT, 0.02),
    "a dictionary": ({"x": 1.0}, ETA_DOT, 0.02),
    "dates": (np.array(["2020-01-01"] * 6, dtype="M8[D]"), ETA_DOT, 0.02),
    "five numbers": (ETA[:5], ETA_DOT, 0.02),
    "a row": (ETA[None, :], ETA_DOT, 0.02),
    "NaN": (ETA * np.nan, ETA_DOT, 0.02),
    "an infinite rate": (ETA, ETA_DOT - np.inf, 0.02),
    "beyond all sensors": ([1e300, 0, 0, 0, 0, 0], ETA_DOT, 0.02),
    "squares overflow": (ETA, [0, 1e200, 0, 0, 0, 0], 0.02),
    "an angle of 1e12": ([0, 0, 0, 1e12, 0, 0], ETA_DOT, 0.02),
    "pitched up": ([0, 0, 0, 0, 1.4, 3.0], ETA_DOT, 0.02),
    "pitched up at 89 deg": ([0.3, 0, 0, 0.05, np.radians(89.0), 0.1], STILL, 0.02),
}


@pytest.mark.parametrize("kind", MAKERS)
def test_a_refused_call_changes_nothing(
    kind: str, one_sentence: Callable[[BaseException], str]
) -> None:
    """The very wrenches and weights of one that was never called so, yaw across half a turn and all."""
    one, twin = MAKERS[kind](), MAKERS[kind]()
    calls = list(WRONG.values())
    for i in range(len(calls)):
        yaw = np.array([0, 0, 0, 0, 0, 2.9 + 0.02 * i])
        pose, rate = ETA * 0.97**i * [1, 1, 1, 1, 1, 0] + yaw, ETA_DOT * 0.97**i
        np.testing.assert_array_equal(one.step(pose, rate, 0.02), twin.step(pose, rate, 0.02))
        np.testing.assert_array_equal(one.zeta, twin.zeta)
        zeta, flags = one.zeta.copy(), one.flags
        with pytest.raises(InputError) as caught:
            one.step(*calls[i])  # type: ignore[arg-type]
        one_sentence(caught.value)
        np.testing.assert_array_equal(one.zeta, zeta)
        assert one.flags == flags == ()
    if isinstance(one, Controller) and isinstance(twin, Controller):
        np.testing.assert_array_equal(one.learner.critic, twin.learner.critic)


def test_numbers_of_other_kinds_are_taken() -> None:
    wrench = frozen().step([1, 0, 0, 0, 0, 0], [0] * 6, 1)
    for pose, dt in (
        ((1, 0, 0, 0, 0, 0), np.int64(1)),
        (np.eye(6)[0].astype(np.float32), np.float32(1.0)),
        (np.eye(6)[0].astype(np.int8), np.array(1.0)),
    ):
        np.testing.assert_array_equal(frozen().step(pose, np.zeros(6, dtype=int), dt), wrench)  # type: ignore[arg-type]


def test_the_case_of_one_attitude_and_of_the_pitch_limit(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """K of -0.13 N m at a roll of 0.02 and a turn farther on; 80 degrees of pitch are refused."""
    with pytest.raises(InputError, match="the pitch is 80"):
        runpy.run_path(str(CASE))
    told = re.findall(r"\[([^]]*)\]", capsys.readouterr().out)
    first, second = ([float(word) for word in wrench.split()] for wrench in told)
    assert first[3] == pytest.approx(-0.13, abs=0.01)
    np.testing.assert_allclose(second, first, atol=1e-9)


@pytest.mark.parametrize("distance", [8.5, 100.0, 1e6])
def test_a_far_station_is_pulled_for_from_the_limit(distance: float) -> None:
    """The wrench of the same direction at χ half-widths; it does not grow any more."""
    direction = np.array([1.0, -0.5, 0.25])
    held, there = frozen(), frozen()
    pose = np.concatenate([distance * direction, ETA[3:]])
    limit = np.concatenate([CHI * HALF_WIDTHS[0] * direction, ETA[3:]])
    np.testing.assert_allclose(
        held.step(pose, ETA_DOT, 0.02), there.step(limit, ETA_DOT, 0.02), rtol=1e-12
    )
    assert held.flags == ("far",)
    assert there.flags == ()
    np.testing.assert_allclose(held.zeta, np.append(pose, ETA_DOT), rtol=1e-15)


@pytest.mark.parametrize("speed", [2.5, 40.0, 1e8])
def test_absurd_rates_are_seen_at_the_limit(speed: float) -> None:
    direction = np.array([0.2, -1.0, 0.4])
    limit = CHI * HALF_WIDTHS[6:9] * direction
    for i in (0, 3):
        rate, believed = ETA_DOT.copy(), ETA_DOT.copy()
        rate[i : i + 3], believed[i : i + 3] = speed * direction, limit
        held, there = frozen(), frozen()
        np.testing.assert_allclose(
            held.step(ETA, rate, 0.02), there.step(ETA, believed, 0.02), rtol=1e-12
        )
        assert held.flags == ("rate",)
        assert there.flags == ()


def test_a_teleport_is_flagged_bounded_and_not_learned_from() -> None:
    held = Controller(quick_scenario())
    for _ in range(13):
        held.step(ETA, ETA_DOT, 0.02)
    assert held.last_step is None
    critic = held.learner.critic.copy()
    moved = ETA + np.array([500.0, 0, 0, 0, 0, 0])
    held.step(moved, ETA_DOT, 0.02)  # the 14th: a learning step would be due
    assert held.flags == ("jump", "far")
    assert held.counts == {"jump": 1, "far": 1}
    assert held.last_step is None
    np.testing.assert_array_equal(held.learner.critic, critic)
    limited = np.concatenate([moved[:3] / (moved[0] / 8.0), ETA[3:], ETA_DOT])
    np.testing.assert_allclose(held.u_control, held.learner.policies(limited)[0], rtol=1e-12)
    held.step(moved, ETA_DOT, 0.02)
    assert held.flags == ("far",)
    held.step(ETA, ETA_DOT, 0.02)
    assert held.flags == ("jump",)
    held.step(ETA, ETA_DOT, 0.02)
    assert held.flags == ()
    assert held.counts == {"jump": 2, "far": 2}


@pytest.mark.parametrize(
    ("change", "flagged"),
    [
        ([1.9, 0, 0, 0, 0, 0] + [0.0] * 6, False),
        ([2.1, 0, 0, 0, 0, 0] + [0.0] * 6, True),
        ([0, 0, 0, 0.41, 0, 0] + [0.0] * 6, True),
        ([0, 0, 0, 0, 0, 2 * np.pi] + [0.0] * 6, False),
        ([0] * 6 + [0.95, 0, 0, 0, 0, 0], False),
        ([0] * 6 + [0, 0, 0, 0, 0, 1.05], True),
    ],
)
def test_a_jump_is_a_half_width_of_the_pose_or_a_width_of_the_rates(
    change: list[float], flagged: bool
) -> None:
    held = frozen()
    held.step(STILL, STILL, 0.02)
    there = np.array(change)
    held.step(there[:6], there[6:], 0.02)
    assert held.flags == (("jump",) if flagged else ())


def test_motion_is_no_jump_however_long_it_takes() -> None:
    """At 1.5 m/s a vehicle gets 0.4 m far in 0.27 s, and any number of turns round."""
    held = frozen()
    for i in range(200):
        t = 0.27 * i
        held.step([1.5 * np.sin(t), 0, 0, 0, 0, 1.9 * t], [1.5 * np.cos(t), 0, 0, 0, 0, 1.9], 0.27)
        assert held.flags == ()


@pytest.mark.parametrize("gap", [0.3, 2.0, 1e4, 1e9])
def test_a_gap_counts_as_the_longest_hold(gap: float) -> None:
    """For weights, covariance and wrench, as if it had been that long."""
    one, twin = Controller(quick_scenario()), Controller(quick_scenario())
    longest = one.limits.gap
    for each, dt in ((one, gap), (twin, longest)):
        each.step(ETA, ETA_DOT, 0.02)
        each.step(0.9 * ETA, 0.9 * ETA_DOT, dt)
    assert one.flags == ("gap",)
    assert twin.flags == ()
    assert one.last_step is not None
    np.testing.assert_array_equal(one.u_control, twin.u_control)
    np.testing.assert_array_equal(one.learner.critic, twin.learner.critic)
    np.testing.assert_array_equal(one.learner.law.information, twin.learner.law.information)  # type: ignore[attr-defined]


def test_nothing_integrates_over_a_gap() -> None:
    """The integral of a cascade grows by the longest hold, not by an hour."""
    one, twin = on_vehicle(), on_vehicle()
    for each, dt in ((one, 3600.0), (twin, one.limits.gap)):
        each.step(0.1 * ETA, STILL, 0.02)
        each.step(0.1 * ETA, STILL, dt)
    assert one.flags == ("gap",)
    np.testing.assert_array_equal(one.step(0.1 * ETA, STILL, 0.02), twin.step(0.1 * ETA, STILL, 0.02))


def test_after_a_gap_angles_are_written_the_short_way() -> None:
    held = frozen()
    for yaw in (3.0, 3.3):
        held.step([0, 0, 0, 0, 0, yaw], STILL, 0.02)
    assert held.zeta[5] == pytest.approx(3.3)
    held.step([0, 0, 0, 0, 0, 3.3], STILL, 2.0)
    assert held.flags == ("gap",)
    assert held.zeta[5] == pytest.approx(3.3 - 2.0 * np.pi)


def test_the_longest_hold_of_a_double_integrator() -> None:
    """u = -k_p x - k_v v held for h: by Jury's conditions stable below min(2 / k_v, 2 k_v / k_p)."""
    for weights in ((1.0, 1.0), (400.0, 1.0), (1.0, 300.0)):
        problem = double_integrators(1, position_weight=weights[0], velocity_weight=weights[1])
        gains = -problem.linear_gain.ravel(), problem.linear_gains[0].ravel()
        holds = [min(2.0 / k_v, 2.0 * k_v / k_p) for k_p, k_v in gains]
        assert longest_hold(problem, 50.0) == pytest.approx(min(holds), rel=1e-6)
        assert longest_hold(problem, 0.5 * min(holds)) == 0.5 * min(holds)


def test_flags_are_logged_ever_more_rarely(caplog: pytest.LogCaptureFixture) -> None:
    held = frozen()
    with caplog.at_level(logging.WARNING, logger="stationkeep"):
        for x in (0.0, 0.1, *(100.0 + 0.1 * i for i in range(25)), 0.0):
            held.step([x, 0, 0, 0, 0, 0], STILL, 0.02)
    told = [record.getMessage().partition(":")[0] for record in caplog.records]
    assert told == ["jump", "far", "far"]
    assert held.counts == {"jump": 2, "far": 25}
    assert "(10 so far)" in caplog.records[-1].getMessage()


class Endless:
    """A law that gives infinite weights."""

    def step(self, critic: Array, rows: object, dt: float) -> Array:
        return np.full_like(critic, np.inf)


def test_a_step_that_was_rolled_back_is_flagged() -> None:
    held = Controller(quick_scenario())
    held.learner.law = Endless()
    before = held.learner.critic.copy()
    assert np.isfinite(held.step(ETA, ETA_DOT, 0.02)).all()
    assert held.flags == ("rollback",)
    np.testing.assert_array_equal(held.learner.critic, before)
    held.step(ETA, ETA_DOT, 0.02)
    assert held.flags == ()


def test_weights_without_a_finite_policy_leave_the_linear_one() -> None:
    held, linear = frozen(), LinearPolicy(quick_scenario().station_keeping().problem)
    held.learner.actor_1 = np.full_like(held.learner.actor_1, np.nan)
    held.step(ETA, ETA_DOT, 0.02)
    np.testing.assert_array_equal(held.u_control, linear.step(np.append(ETA, ETA_DOT), 0.02))


def test_a_policy_that_is_not_finite_gives_no_wrench() -> None:
    station = quick_scenario().station_keeping()
    policy = LinearPolicy(station.problem)
    driven = OnVehicle(policy, station)
    driven.step(ETA, ETA_DOT, 0.02)
    policy.gain = policy.gain * np.nan
    with pytest.raises(RunError, match="not finite"):
        driven.step(0.5 * ETA, ETA_DOT, 0.02)
    np.testing.assert_array_equal(driven.zeta, np.append(ETA, ETA_DOT))


@pytest.mark.parametrize(
    "station", [None, 3.0, ["a", "b", "c", "d"], "home", [[0.0] * 4], [1e400, 0, 0, 0]]
)
def test_what_is_no_station_is_refused(
    station: Any, one_sentence: Callable[[BaseException], str]
) -> None:
    with pytest.raises(InputError, match="four finite numbers") as caught:
        Controller(quick_scenario(), station)
    one_sentence(caught.value)


def garbage(rng: np.random.Generator) -> tuple[Array, Array, float]:
    """Return a measurement of any size, now and then with what is not finite, and any time step."""
    sizes = 10.0 ** rng.uniform(-300.0, 300.0, 12) if rng.random() < 0.3 else np.full(12, 0.3)
    numbers = sizes * rng.standard_normal(12)
    if rng.random() < 0.2:
        numbers[rng.integers(12)] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -0.0, 1e9])
    dt = rng.choice([0.02, 0.0, -1.0, 1e-300, 1e-9, 0.25, 2.0, 1e12, 1e308, np.nan, np.inf])
    return numbers[:6], numbers[6:], float(dt)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ["frozen", "pid"])
def test_whatever_comes_the_wrench_is_finite(kind: str) -> None:
    """Bounded too: by what the policy asks for within its limits."""
    held, rng, answered = MAKERS[kind](), np.random.default_rng(5), 0
    for _ in range(3000):
        with contextlib.suppress(InputError):
            wrench = held.step(*garbage(rng))
            answered += 1
            assert np.abs(wrench).max() < 1e4
    assert answered > 300
