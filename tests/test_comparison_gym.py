"""The Gymnasium environment: its checker, the costs of the runs, and how an episode ends."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stationkeep.comparison import Scenario
from stationkeep.comparison.adapters.gym import StationKeepingEnv
from stationkeep.comparison.records import online_record
from stationkeep.symbolic import InputError
from stationkeep.symbolic.underwater import STATE_NAMES

from .commands import QUICK
from .games import Array, linear_on, quick_scenario

CALM = "simulation.mode=disturbed"  # no second player, and no disturbance


@pytest.mark.parametrize("actions", ["thrusters", "wrench"])
def test_gymnasium_accepts_it(actions: Any) -> None:
    env = StationKeepingEnv(quick_scenario(), actions=actions)
    check_env(env, skip_render_check=True)  # it draws nothing
    assert env.action_space.shape == ((8,) if actions == "thrusters" else (6,))


def test_a_vehicle_without_thrusters_and_with_noise_and_waves() -> None:
    settings = ["simulation.noise.position=0.05", "simulation.disturbance.kind=waves"]
    settings.append("simulation.mode=disturbed")
    env = StationKeepingEnv(Scenario.load("rexrov", [*QUICK, *settings]))
    check_env(env, skip_render_check=True)
    first, info = env.reset(seed=3)
    assert not np.allclose(first[:3], info["zeta"][:3] / env.station.half_widths[:3], atol=1e-3)
    np.testing.assert_allclose(first[3:], info["zeta"][3:] / env.station.half_widths[3:], rtol=1e-6)


@pytest.mark.parametrize("actions", ["thrusters", "wrench"])
def test_the_return_is_the_cost_of_the_run(actions: Any) -> None:
    """The linear policy through the environment, beside the record of the same run."""
    game = quick_scenario(CALM)
    station = game.station_keeping()
    record = online_record(game, policy=lambda: linear_on(station), kind="linear")
    env, policy = (
        StationKeepingEnv(game, actions=actions),
        linear_on(station),
    )
    _, info = env.reset(seed=0, options={"state": game.initial_state})
    total, states, ended = 0.0, [info["zeta"]], False
    while not ended:
        zeta = info["zeta"]
        tau_b = policy.step(zeta[:6], zeta[6:], game.simulation.control_period)
        _, reward, terminated, ended, info = env.step(share(env, tau_b))
        assert not terminated
        total += reward
        states.append(info["zeta"])
    assert len(states) == len(record["time"])
    assert info["time"] == pytest.approx(float(record["time"][-1]))
    # an action has the 24 bits of a float32
    np.testing.assert_allclose(states, record["zeta"], rtol=0, atol=1e-6)
    assert -total == pytest.approx(float(record["cost"][-1]), rel=1e-6)
    assert info["rest"] == pytest.approx(info["zeta"] @ station.problem.P @ info["zeta"])


def share(env: StationKeepingEnv, tau_b: Array) -> Any:
    """Return the action with this wrench; there is no trim."""
    thrusters = env.station.model.vehicle.thrusters
    if env.action_space.shape == (6,):
        return (tau_b / env.wrench_scale).astype(np.float32)
    assert thrusters is not None
    thrust, (reverse, forward) = np.linalg.pinv(thrusters.matrix) @ tau_b, thrusters.limits
    return np.where(thrust > 0.0, thrust / forward, thrust / -reverse).astype(np.float32)


def test_full_thrust_is_the_limit_of_the_thrusters() -> None:
    """One period of all vertical thrusters at full thrust: z_ddot = 4 x limit / (m + Z_w_dot)."""
    env = StationKeepingEnv(quick_scenario(CALM))
    for command, limit in ((1.0, 51.5), (-1.0, 39.9), (-3.0, 39.9)):
        env.reset(seed=0, options={"state": np.zeros(12)})
        action = np.array([0, 0, 0, 0, command, command, command, command], dtype=np.float32)
        info = env.step(action)[4]
        expected = -np.sign(command) * 4 * limit / (13.5 + 18.68) * 0.02
        assert info["zeta"][8] == pytest.approx(expected, rel=0.02)  # linear drag takes 1 %


def test_leaving_chi_ends_the_episode_and_costs_what_staying_there_would() -> None:
    game = quick_scenario(CALM, "simulation.duration=60")
    env = StationKeepingEnv(game)
    state = np.zeros(12)
    state[0], state[6] = 7.99, 0.9
    env.reset(seed=0, options={"state": state})
    total, terminated = 0.0, False
    while not terminated:
        observation, reward, terminated, truncated, info = env.step(np.zeros(8, dtype=np.float32))
        total += reward
        assert not truncated
    assert info["stopped"]
    assert abs(info["zeta"][0]) > 8.0, "chi is 4, the half-width 2 m"
    assert observation[0] == pytest.approx(info["zeta"][0] / 2.0, rel=1e-6)
    rate = info["zeta"] @ game.station_keeping().game.Q @ info["zeta"]
    assert -total == pytest.approx(info["cost"] + rate * (60.0 - info["time"]))


def test_starts_are_seeded_and_lie_in_the_envelope() -> None:
    game = quick_scenario("envelope.scale=0.5")
    env = StationKeepingEnv(game)
    half = 0.5 * np.array(game.envelope.half_widths)
    starts = np.array([env.reset(seed=seed)[1]["zeta"] for seed in range(40)])
    np.testing.assert_array_equal(starts[7], env.reset(seed=7)[1]["zeta"])
    assert np.all(np.abs(starts) < half)
    assert np.all(np.abs(starts / half).max(axis=0) > 0.7), dict(
        zip(STATE_NAMES, starts.T, strict=True)
    )
    np.testing.assert_array_equal(env.reset(seed=1)[0], (starts[1] / (2 * half)).astype(np.float32))


def test_a_buoyant_vehicle_is_trimmed_in_wrenches() -> None:
    game = Scenario.load("bluerov2-heavy-buoyant", [*QUICK, CALM])
    env = StationKeepingEnv(game, actions="wrench")
    env.reset(seed=0, options={"state": np.zeros(12)})
    for _ in range(20):
        _, reward, _, _, info = env.step(np.zeros(6, dtype=np.float32))
    np.testing.assert_allclose(info["zeta"], np.zeros(12), atol=1e-9)
    assert reward == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda env: env.step(np.zeros(3)), "8 finite numbers"),
        (lambda env: env.step(np.full(8, np.nan)), "8 finite numbers"),
        (lambda env: env.reset(options={"state": [1, 2]}), "12 numbers"),
        (lambda env: StationKeepingEnv(env.scenario, actions="sails"), "sails"),
        (lambda env: StationKeepingEnv("rexrov", actions="thrusters"), "wrench"),
    ],
)
def test_bad_input(
    call: Callable[[StationKeepingEnv], object],
    words: str,
    one_sentence: Callable[[BaseException], str],
) -> None:
    env = StationKeepingEnv(quick_scenario())
    with pytest.raises(InputError) as caught:
        call(env)
    assert words in one_sentence(caught.value)


def test_without_gymnasium(
    monkeypatch: pytest.MonkeyPatch, one_sentence: Callable[[BaseException], str]
) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "stationkeep.comparison.adapters.gym")
    with pytest.raises(InputError) as caught:
        importlib.import_module("stationkeep.comparison.adapters.gym")
    assert "stationkeep[gym]" in one_sentence(caught.value)
