"""The python-control systems against its own simulation, the plant of the runs and an oracle."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from stationkeep.comparison import Scenario
from stationkeep.comparison.adapters.control import to_control
from stationkeep.comparison.policies import OnVehicle
from stationkeep.comparison.policies.pid import CascadedPID
from stationkeep.online import Controller, build_disturbance, save
from stationkeep.online.loop import PlantState
from stationkeep.online.vehicle import HeldPlant
from stationkeep.symbolic import InputError

from .commands import QUICK
from .fossen import PARAMETERS, Body, jacobian
from .games import Array, linear_on, quick_scenario

START = np.array([0.8, -0.5, 0.4, 0.1, -0.1, 0.6, 0.1, 0.05, -0.1, 0.1, -0.05, 0.1])
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
PUSH = np.array([3.0, -2.0, 4.0, 0.2, -0.1, 0.3])


@cache
def scenario(name: str) -> Scenario:
    return Scenario.load(name, QUICK)


def simulated(system: Any, times: Array, inputs: Array, start: Array = START) -> Array:
    """Return python-control's own simulation, (outputs, times)."""
    answer = control.input_output_response(system, times, inputs, start, solve_ivp_kwargs=TIGHT)
    return np.asarray(answer.outputs)


def test_names() -> None:
    plant = to_control(scenario("bluerov2-heavy"))
    assert isinstance(plant, control.NonlinearIOSystem)
    assert plant.isctime(strict=True)
    assert plant.state_labels[:7] == ["x", "y", "z", "phi", "theta", "psi", "x_dot"]
    assert plant.output_labels == plant.state_labels
    assert plant.input_labels == ["tau_X", "tau_Y", "tau_Z", "tau_K", "tau_M", "tau_N"]
    closed = to_control(
        scenario("bluerov2-heavy"),
        linear_on(quick_scenario().station_keeping()),
    )
    assert closed.input_labels[0] == "tau_d_X"
    assert closed.output_labels == [*plant.state_labels, *plant.input_labels]


def test_a_name_with_a_dot_is_another() -> None:
    """python-control refuses it."""
    dotted = Scenario.load("bluerov2-heavy", ['vehicle_parameters.name="BlueROV2 v1.1"'])
    assert to_control(dotted).name == "BlueROV2 v1_1"


def test_the_plant_agrees_with_the_plant_of_the_runs() -> None:
    game = scenario("bluerov2-heavy")
    held = HeldPlant(game.station_keeping(), build_disturbance(game.simulation.disturbance), 1e-11)
    state = PlantState(START, 0.0, 0.0)
    for i in range(10):
        state = held.advance(0.2 * i, state, PUSH, np.zeros(6), 0.2)
    times = np.linspace(0.0, 2.0, 11)
    found = simulated(to_control(game), times, np.tile(PUSH[:, None], 11))
    np.testing.assert_allclose(found[:, -1], state.zeta, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["bluerov2-heavy-buoyant", "rexrov"])
def test_the_plant_agrees_with_an_independent_model(name: str) -> None:
    """Fossen's equations in plain numpy, integrated by scipy; a wrench that grows with time."""
    body, size = Body(PARAMETERS[name]), PARAMETERS[name]["mass"] / 13.5

    def rates(t: float, zeta: Array) -> Array:
        return np.concatenate([zeta[6:], body.acceleration(zeta, t * size * PUSH)])

    times = np.linspace(0.0, 2.0, 6)
    found = simulated(to_control(scenario(name)), times, size * PUSH[:, None] * times)
    expected = solve_ivp(rates, (0.0, 2.0), START, t_eval=times, method="DOP853", **TIGHT).y
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


def test_the_closed_loop_agrees_with_an_independent_model() -> None:
    """The linear policy with the trim of a buoyant vehicle, against a push and a known current."""
    current = (0.2, -0.1, 0.05)
    settings = [*QUICK, f"current={list(current)}"]
    game = Scenario.load("bluerov2-heavy-buoyant", settings)
    station = game.station_keeping()
    body = Body(PARAMETERS["bluerov2-heavy-buoyant"])
    _, B = station.problem.linearization
    gain = np.linalg.solve(station.game.R, B.T @ station.problem.P)
    trim = np.linalg.solve(
        body.input_matrix(np.zeros(6)), -body.acceleration(np.zeros(12), water_velocity=current)
    )

    def wrench(zeta: Array) -> Array:
        return np.asarray(jacobian(zeta[:6]).T @ (trim - gain @ zeta))

    def rates(t: float, zeta: Array) -> Array:
        pushed = wrench(zeta) + PUSH
        return np.concatenate([zeta[6:], body.acceleration(zeta, pushed, current)])

    times = np.linspace(0.0, 5.0, 6)
    found = simulated(
        to_control(game, linear_on(station)),
        times,
        np.tile(PUSH[:, None], 6),
    )
    expected = solve_ivp(rates, (0.0, 5.0), START, t_eval=times, method="DOP853", **TIGHT).y
    np.testing.assert_allclose(found[:12], expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found[12:, -1], wrench(expected[:, -1]), rtol=0, atol=1e-6)


def test_linearised_by_python_control_it_is_the_linear_game() -> None:
    game = scenario("bluerov2-heavy")
    problem = game.station_keeping().problem
    A, B = problem.linearization
    plant = to_control(game).linearize(np.zeros(12), np.zeros(6), eps=1e-7)
    np.testing.assert_allclose(plant.A, A, atol=2e-5)
    np.testing.assert_allclose(plant.B, B, atol=1e-6)
    policy = linear_on(game.station_keeping())
    closed = to_control(game, policy).linearize(np.zeros(12), np.zeros(6), eps=1e-7)
    found, expected = (
        np.sort_complex(closed.poles()),
        np.sort_complex(np.linalg.eigvals(A - B @ problem.linear_gains[0])),
    )
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert found.real.max() < 0.0


def test_a_frozen_learned_policy(tmp_path: Path) -> None:
    """û_1 = -R^-1 g'σ'Ŵ_a1 / 2 (14) at the weights of a file; yaw is taken within ±π."""
    weights = quick_scenario().station_keeping().riccati_weights
    weights = weights * np.random.default_rng(3).uniform(0.8, 1.2, len(weights))
    save(xr.Dataset({"ideal_weights": ("basis", weights)}), tmp_path / "weights.nc")
    game = quick_scenario(f"learner.weights='{tmp_path / 'weights.nc'}'")
    station = game.station_keeping()
    system = to_control(game, Controller(game, learn=False))
    rng = np.random.default_rng(4)
    for zeta in station.envelope * rng.uniform(-1, 1, (5, 12)):
        sigma_prime = station.functions.sigma_prime(zeta)[0]
        g = station.model.input_matrix(zeta)
        u = -0.5 * station.game.R_inverse @ g.T @ sigma_prime.T @ weights
        expected = jacobian(zeta[:6]).T @ u
        np.testing.assert_allclose(system.output(0.0, zeta, np.zeros(6))[12:], expected, rtol=1e-9)
        turned = zeta + 2 * np.pi * np.eye(12)[5]
        np.testing.assert_allclose(system.output(0.0, turned, np.zeros(6))[12:], expected, rtol=1e-7)


def test_another_vehicle_may_be_driven() -> None:
    game = quick_scenario("simulation.plant='bluerov2-heavy-2024'")
    body = Body(PARAMETERS["bluerov2-heavy-2024"])
    found = to_control(game).dynamics(0.0, START, PUSH)
    np.testing.assert_allclose(found[6:], body.acceleration(START, PUSH), rtol=1e-10)


def test_policies_with_a_memory_are_refused(
    one_sentence: Callable[[BaseException], str],
) -> None:
    game = quick_scenario()
    for policy in (
        OnVehicle(CascadedPID(game.station_keeping()), game.station_keeping()),
        Controller(game),
    ):
        with pytest.raises(InputError) as caught:
            to_control(game, policy)
        assert type(getattr(policy, "policy", policy)).__name__ in one_sentence(caught.value)


def test_without_python_control(
    monkeypatch: pytest.MonkeyPatch, one_sentence: Callable[[BaseException], str]
) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(InputError) as caught:
        to_control(quick_scenario())
    assert "stationkeep[control]" in one_sentence(caught.value)
