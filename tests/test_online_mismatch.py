"""Measurement noise, another vehicle as the plant, and what they amount to as a disturbance."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from stationkeep.comparison.merit import dissipation_margin
from stationkeep.comparison.records import online_record, provenance
from stationkeep.online import NoiseSettings, run
from stationkeep.online.vehicle import MeasurementNoise
from stationkeep.symbolic import InputError, Model, Vehicle

from .games import Array, linear_on, quick_scenario

NOISE = "simulation.noise={position=0.02, attitude=0.01, velocity=0.03, rate=0.005, seed=7}"
OTHER = "simulation.plant=bluerov2-heavy-2024"
DISTURBED = "simulation.mode=disturbed"


def test_noise_has_the_stated_deviations() -> None:
    settings = NoiseSettings(position=0.02, attitude=0.01, velocity=0.03, rate=0.005, seed=7)
    noise, zeta = MeasurementNoise(settings), np.arange(12.0)
    seen = np.array([noise.measure(zeta) for _ in range(20_000)]) - zeta
    stated = np.repeat([0.02, 0.01, 0.03, 0.005], 3)
    np.testing.assert_allclose(seen.std(axis=0), stated, rtol=0.02)  # 4 sigma of an estimate
    assert np.all(np.abs(seen.mean(axis=0)) < 4.0 * stated / np.sqrt(20_000))
    correlation = np.corrcoef(np.hstack([seen[:-1], seen[1:]]).T) - np.eye(24)
    assert np.abs(correlation).max() < 0.04


class Listening:
    """Does nothing, and remembers what it saw."""

    u_disturbance = np.zeros(6)

    def __init__(self) -> None:
        self.seen: list[Array] = []

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        self.seen.append(np.concatenate([eta, eta_dot]))
        return np.zeros(6)

    def body_wrench(self, u: Array) -> Array:
        return u


def heard(*overrides: str) -> tuple[Array, Array]:
    policy = Listening()
    history = run(quick_scenario(DISTURBED, "simulation.duration=1", *overrides), policy)
    return np.array(policy.seen), np.array(history.zeta)


def test_the_policy_sees_the_noise_and_the_plant_does_not() -> None:
    seen, true = heard(NOISE)
    quiet, same = heard()
    np.testing.assert_array_equal(quiet, same)
    np.testing.assert_array_equal(true, same)
    assert np.all(seen != true)
    again, _ = heard(NOISE)
    np.testing.assert_array_equal(seen, again)
    other, _ = heard(NOISE.replace("seed=7", "seed=8"))
    assert np.all(seen != other)


def test_the_plant_may_be_another_vehicle() -> None:
    """Its acceleration is the other vehicle's, by that vehicle's own compiled dynamics."""
    scenario = quick_scenario(DISTURBED, OTHER, "simulation.duration=2")
    station, other = scenario.station_keeping(), Model(Vehicle.load("bluerov2-heavy-2024"))
    history = run(scenario, linear_on(station))
    for i in (0, 50, 100):
        zeta, tau_b = history.zeta[i], history.tau_b[i]
        (rate,) = other.plant(zeta, tau_b, np.zeros(6), np.zeros(3), np.zeros(3))
        M, C, D, g = station.model.earth_frame(zeta)
        (J,) = station.model.kinematics(zeta[:6])
        expected = M @ rate[6:] + (C + D) @ zeta[6:] + g.ravel() - np.linalg.solve(J.T, tau_b)
        np.testing.assert_allclose(history.disturbance[i], expected, atol=1e-9)
    assert np.abs(history.disturbance[50]).max() > 0.5


def test_no_disturbance_in_still_water() -> None:
    history = run(quick_scenario(DISTURBED, "simulation.plant=bluerov2-heavy"))
    np.testing.assert_allclose(history.disturbance, 0.0, atol=1e-9)
    assert history.attenuated[-1] == pytest.approx(0.0, abs=1e-12)
    same = run(quick_scenario(DISTURBED))
    np.testing.assert_allclose(history.zeta[-1], same.zeta[-1], atol=1e-12)


def test_records_know_the_plant() -> None:
    keys = {provenance(quick_scenario(*set_), "linear")["key"] for set_ in ((), (OTHER,), (NOISE,))}
    assert len(keys) == 3
    with pytest.raises(InputError, match="there is no vehicle 'bluerov3'"):
        run(quick_scenario("simulation.plant=bluerov3"))


def test_dissipation_of_the_linear_quadratic_game() -> None:
    """With V = ζ'P ζ and u_1 = -R^-1 B'P ζ the margin is γ^2 ∫ |d - γ^-2 W_d^-1 B'P ζ|^2_Wd.

    Completing the square in the Riccati equation; millimetres, where the vehicle is nearly linear.
    """
    scenario = quick_scenario(
        DISTURBED,
        "simulation.initial_state=[1e-4,-5e-5,1e-4,1e-5,2e-5,-5e-5,0,0,0,0,0,0]",
        "simulation.disturbance.kind=sinusoid",
        "simulation.disturbance.force=[1e-3, -2e-3, 1e-3, 1e-4, 2e-4, 1e-4]",
        "simulation.control_period=0.005",
        "simulation.tolerance=1e-10",
    )
    station = scenario.station_keeping()
    record = online_record(scenario, policy=lambda: linear_on(station), kind="linear")
    zeta, d = record["zeta"].values, record["u_disturbance"].values
    game, P = station.game, station.problem.P
    B = np.vstack([np.zeros((6, 6)), np.linalg.inv(station.model.vehicle.M)])
    worst = zeta @ P @ B @ np.linalg.inv(game.W_d) / game.gamma**2
    gap = np.sum(((d - worst) @ game.W_d) * (d - worst), axis=1)
    expected = game.gamma**2 * np.trapezoid(gap, record["time"].values)
    ends = [float(end @ P @ end) for end in (zeta[0], zeta[-1])]
    margin = dissipation_margin(record, *ends)
    assert margin == pytest.approx(expected, rel=5e-3)
    assert all(later > earlier for earlier, later in pairwise(record["attenuated"].values[1:]))
