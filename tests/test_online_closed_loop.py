"""Closed-loop runs: stable, repeatable, and ended with a reason that keeps what was recorded."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.offline import DirectSolver
from stationkeep.online import Controller, History, run
from stationkeep.symbolic import InputError, RunError
from stationkeep.symbolic.value import BOUND

from .games import Array, quick_scenario

N_STEPS = 100  # of 0.02 s in 2 s


class Held:
    """A policy without learning that returns a given wrench, from a given step on."""

    def __init__(self, wrench: Array, after: int = 0, other: Array | None = None) -> None:
        self.wrench, self.after, self.calls = wrench, after, 0
        self.u_disturbance = np.zeros(6) if other is None else other

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        self.calls += 1
        return self.wrench if self.calls > self.after else np.zeros(6)

    def body_wrench(self, u: Array) -> Array:
        return u


def stack(history: History) -> dict[str, Array]:
    lists = {
        name: value
        for name, value in vars(history).items()
        if isinstance(value, list) and value and name not in ("looks", "policy_seconds")
    }
    seen = [vars(look) for look in history.looks]
    lists |= {f"look's {name}": [look[name] for look in seen] for name in (seen[0] if seen else ())}
    return {name: np.array(value) for name, value in lists.items()}


def energy(zeta: Array) -> float:
    """ζ'P ζ, a Lyapunov function near the origin."""
    return float(zeta @ quick_scenario().station_keeping().problem.P @ zeta)


@pytest.mark.parametrize("mode", ["game", "disturbed"])
def test_short_run_approaches_its_station(mode: str) -> None:
    history = run(quick_scenario(f"simulation.mode={mode}", "simulation.duration=6"))
    assert history.stopped is None
    values = [energy(zeta) for zeta in history.zeta[:: N_STEPS // 2]]
    assert np.all(np.diff(values) < 0.0)
    assert values[-1] < 0.3 * values[0]
    assert history.time[-1] == pytest.approx(6.0)
    assert len(history.time) == 301
    assert history.wall_seconds > 0.0


@pytest.mark.slow
def test_shipped_scenario_holds_its_station() -> None:
    """A minute with 144 functions: the vehicle arrives, and the learner gets better at the samples."""
    history = run(Scenario.load("bluerov2-heavy"))
    assert history.stopped is None
    half_widths = quick_scenario().station_keeping().half_widths
    assert np.abs(history.zeta[-1] / half_widths).max() < 0.02
    assert history.sample_error[-1] < 0.7 * history.sample_error[0]
    assert not any(history.projecting)


@pytest.mark.slow
def test_rank_condition_holds_with_the_bellman_error_at_fixed_samples() -> None:
    """(18) along a minute of the paper's error; costate rows follow the vehicle and don't give it."""
    settings = ["learner.error=bellman", "learner.safeguard=false", "learner.leash=0.005"]
    settings += [f"learner.{name}=2.0" for name in ("gain_actor_1", "gain_actor_2", "forgetting")]
    history = run(Scenario.load("bluerov2-heavy", settings))
    assert history.stopped is None
    assert history.sample_error[-1] < 0.7 * history.sample_error[0]
    assert min(look.rank_margin for look in history.looks) > 0.0
    assert not any(history.projecting)


def test_record_is_complete_and_in_step() -> None:
    scenario = quick_scenario()
    history = run(scenario)
    records = stack(history)
    every_step = ("time", "zeta", "tau_b", "u_control", "disturbance", "cost", "attenuated")
    assert {len(records[name]) for name in every_step} == {N_STEPS + 1}
    np.testing.assert_allclose(records["time"], 0.02 * np.arange(N_STEPS + 1), atol=1e-12)
    np.testing.assert_array_equal(records["zeta"][0], scenario.initial_state)
    learning = ("learn_time", "bellman_error", "sample_error", "projecting", "critic", "actor_1")
    assert len({len(records[name]) for name in learning}) == 1
    assert np.all(np.diff(records["cost"]) > 0.0)
    assert np.all(np.diff(records["attenuated"]) > 0.0)
    assert np.all(np.isfinite(records["zeta"]))
    setup = scenario.station_keeping()
    for i in (0, 40, N_STEPS):
        zeta = records["zeta"][i]
        (J,) = setup.model.kinematics(zeta[:6])
        np.testing.assert_allclose(records["tau_b"][i], J.T @ records["u_control"][i], atol=1e-9)
        applied = np.linalg.solve(J.T, records["tau_b"][i])
        np.testing.assert_allclose(records["disturbance"][i], -applied / 4.0, atol=1.0)


def test_costs_of_the_record_are_integrals_of_it() -> None:
    """Trapezoids over the record against the plant's own integral, in a force's presence."""
    scenario = quick_scenario(
        "simulation.mode=disturbed",
        "simulation.disturbance.kind=sinusoid",
        "simulation.disturbance.force=[2.0, 1.0, 0.5, 0.1, 0.1, 0.1]",
    )
    history, game = run(scenario), scenario.station_keeping().game
    zeta, u, d = (np.array(a) for a in (history.zeta, history.u_control, history.disturbance))
    running = np.sum((zeta @ game.Q) * zeta, axis=1) + np.sum((u @ game.R) * u, axis=1)
    attenuated = game.gamma**2 * np.sum((d @ game.W_d) * d, axis=1)
    assert history.cost[-1] == pytest.approx(np.trapezoid(running, history.time), rel=0.01)
    assert history.attenuated[-1] == pytest.approx(np.trapezoid(attenuated, history.time), rel=0.01)
    expected = np.array([2.0, 1.0, 0.5, 0.1, 0.1, 0.1])
    phases = np.sin(2.0 * np.pi * 0.1 * np.array(history.time))
    np.testing.assert_allclose(d, phases[:, None] * expected, atol=1e-9)


def test_same_seeds_give_the_same_bits() -> None:
    sea = ("simulation.mode=disturbed", "simulation.disturbance.kind=waves")
    first, again = stack(run(quick_scenario(*sea))), stack(run(quick_scenario(*sea)))
    assert first.keys() == again.keys()
    for name, value in first.items():
        np.testing.assert_array_equal(value, again[name], err_msg=name)
    other = stack(run(quick_scenario(*sea, "simulation.disturbance.seed=2")))
    assert np.all(first["zeta"][-1] != other["zeta"][-1])
    sampled = stack(run(quick_scenario(*sea, "samples.seed=2")))
    assert np.all(first["critic"][-1] != sampled["critic"][-1])


def test_progress_is_called_with_the_time_after_each_period() -> None:
    seen: list[float] = []
    run(quick_scenario("simulation.duration=0.1"), progress=seen.append)
    np.testing.assert_allclose(seen, [0.02, 0.04, 0.06, 0.08, 0.1], atol=1e-12)


def assert_ends(history: History, reason: str) -> None:
    """The run ended early for a reason, and kept what it had."""
    assert history.stopped is not None
    assert reason in history.stopped, history.stopped
    lengths = {len(a) for a in (history.time, history.zeta, history.tau_b, history.cost)}
    assert len(lengths) == 1
    assert 0 < lengths.pop() < N_STEPS + 1
    assert np.all(np.isfinite(history.zeta))
    assert f"t = {history.time[-1] + 0.02:.2f} s" in history.stopped or "failed" in history.stopped


def test_run_ends_when_the_pitch_leaves_its_band() -> None:
    scenario = quick_scenario("simulation.pitch_limit=20", "simulation.chi=100")
    history = run(scenario, Held(np.array([0, 0, 0, 0, 3.0, 0])))
    assert_ends(history, "the pitch left ±20 deg (20.")
    assert np.degrees(history.zeta[-1][4]) <= 20.0


def test_the_optimum_stays_in_the_default_chi() -> None:
    """From the corner where it goes farthest, the optimum spins at three half-widths, beyond two."""
    station = quick_scenario().station_keeping()
    signs = np.array([1, 1, 1, 1, 1, 1, -1, 1, -1, 1, 1, -1])
    solver = DirectSolver(station.problem, horizon=60.0, n_intervals=16, degree=6, grading=6.0)
    states = solver.solve(signs * station.half_widths, verify=False).trajectory.states
    farthest = np.abs(states / station.half_widths).max()
    assert farthest == pytest.approx(3.15, abs=0.01)
    assert farthest < quick_scenario().simulation.chi == BOUND


def test_run_ends_when_the_state_leaves_chi() -> None:
    history = run(quick_scenario("simulation.chi=0.5"), Held(np.array([60.0, 0, 0, 0, 0, 0])))
    assert_ends(history, "the state left chi (x_dot is 0.5")
    assert np.abs(history.zeta[-1][6]) <= 0.25


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_run_ends_when_a_policy_is_not_finite(value: float) -> None:
    history = run(quick_scenario(), Held(np.full(6, value), after=3))
    assert history.stopped is not None
    assert "t = 0.06" in history.stopped
    assert len(history.time) == 4
    assert np.all(np.isfinite(history.zeta))


def test_run_ends_when_the_other_player_is_not_finite() -> None:
    history = run(quick_scenario(), Held(np.zeros(6), other=np.full(6, np.nan)))
    assert history.stopped is not None
    assert len(history.time) == 1


def test_run_ends_when_the_controller_fails() -> None:
    class Failing(Held):
        def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
            if self.calls == 5:
                raise InputError("the sensor is gone")
            return super().step(eta, eta_dot, dt)

    history = run(quick_scenario(), Failing(np.zeros(6)))
    assert history.stopped == "the controller failed at t = 0.10 s: the sensor is gone"
    assert len(history.time) == 5


def test_a_run_that_fails_at_once_has_nothing_but_a_reason() -> None:
    class Broken(Held):
        def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
            raise RunError("no thrust")

    history = run(quick_scenario(), Broken(np.zeros(6)))
    assert history.stopped == "the controller failed at t = 0.00 s: no thrust"
    assert history.time == []


def test_interrupted_run_keeps_what_it_has() -> None:
    def interrupt(t: float) -> None:
        if t > 0.99:
            raise KeyboardInterrupt

    history = run(quick_scenario(), progress=interrupt)
    assert history.stopped is not None
    assert history.stopped.startswith("interrupted at t = 0.9")
    assert len(history.time) == len(history.zeta) == 50
    assert len(history.critic) == len(history.learn_time) > 0


def test_learned_weights_are_recorded_as_they_become_active() -> None:
    scenario = quick_scenario()
    history = run(scenario)
    start = scenario.station_keeping().riccati_weights
    np.testing.assert_array_equal(history.critic[0], start)
    learn_time = np.array(history.learn_time)
    assert np.all(np.diff(learn_time) >= 0.0)
    assert learn_time[-1] == history.time[-1]
    by_hand = Controller(scenario)
    for i, t in enumerate(history.time):
        by_hand.step(history.zeta[i][:6], history.zeta[i][6:], 0.02)
        if by_hand.last_step is not None:
            assert t in learn_time
    np.testing.assert_array_equal(history.critic[-1], by_hand.learner.critic)


def test_the_monitor_looks_at_its_own_pace_and_at_the_end() -> None:
    history = run(quick_scenario("simulation.monitor_period=0.75"))
    every_third = history.learn_time[:-1:3]
    assert [look.time for look in history.looks] == [*every_third, history.time[-1]]


@pytest.mark.parametrize(
    ("kind", "given"),
    [
        ("constant", ["force=[3.0, 0, 0, 0, 0, 0]", "start=0.5"]),
        ("current", ["velocity=[0.1, 0.05, 0]", "start=0.5"]),
        ("waves", []),
    ],
)
def test_disturbed_runs_hold_on(kind: str, given: list[str]) -> None:
    history = run(
        quick_scenario(
            "simulation.mode=disturbed",
            f"simulation.disturbance.kind={kind}",
            *(f"simulation.disturbance.{text}" for text in given),
        )
    )
    assert history.stopped is None
    d = np.abs(history.disturbance).max(axis=1)
    before = np.array(history.time) < 0.5
    assert d[~before].max() > 0.5
    assert kind == "waves" or d[before].max() < 1e-9


def test_reasons_are_one_sentence(one_sentence: Callable[[BaseException], str]) -> None:
    hard, spun = np.array([60.0, 0, 0, 0, 0, 0]), np.array([0, 0, 0, 0, 3.0, 0])
    for policy, limit in (
        (Held(hard), "simulation.chi=0.5"),
        (Held(spun), "simulation.pitch_limit=20"),
        (Held(np.full(6, np.nan)), "simulation.chi=2"),
    ):
        reason = run(quick_scenario(limit), policy).stopped
        assert reason is not None
        one_sentence(RuntimeError(reason))
