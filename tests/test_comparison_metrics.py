"""Figures of merit against independent computations: regret, dissipation, quadrature, thrust."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import xarray as xr
from casadi import collocation_points
from scipy.integrate import quad, solve_ivp, trapezoid
from stationkeep.comparison.merit import (
    Regret,
    cost_to_date,
    dissipation_margin,
    game_cost,
    regret,
    run_metrics,
)
from stationkeep.comparison.merit.metrics import energy, peak_thrust
from stationkeep.comparison.records import online_record, optimal_record
from stationkeep.offline import OfflineSolver, QuickValue, Trajectory
from stationkeep.offline.path import MeshSettings
from stationkeep.online import run, to_dataset
from stationkeep.symbolic import Setup, Vehicle

from .games import (
    FAR_STATE,
    FAR_VALUE,
    FAST_STATE,
    FAST_VALUE,
    Array,
    linear_on,
    quick_scenario,
    two_state,
)

FROM_REST = "simulation.initial_state=[0,0,0,0,0,0,0,0,0,0,0,0]"
DISTURBED = ("simulation.mode=disturbed", "simulation.disturbance.kind=constant")
PUSH = "simulation.disturbance.force=[2,-1,1,0.05,-0.05,0.1]"


@cache
def optimum() -> xr.Dataset:
    scenario = quick_scenario("offline.horizon=40", "offline.intervals=12", "offline.aligned=false")
    solver = OfflineSolver(scenario.station_keeping().problem, scenario.offline)
    return optimal_record(scenario, solver)


@cache
def disturbed() -> xr.Dataset:
    """Return a run from rest under a constant force."""
    return online_record(quick_scenario(FROM_REST, *DISTURBED, PUSH, "simulation.duration=3"))


@cache
def learned() -> xr.Dataset:
    return online_record(quick_scenario())


def test_distribution_of_finished_runs() -> None:
    """The quantile q is number ceil(q (n - 1)) from zero: of five the third, the fifth, the fifth."""
    answer = Regret.of([0.4, 0.1, 0.3, 0.2, 0.5])
    assert (answer.median, answer.p90, answer.max) == (0.3, 0.5, 0.5)
    assert (answer.n, answer.diverged, answer.note) == (5, 0, None)
    assert answer.as_json() == {"median": 0.3, "p90": 0.5, "max": 0.5, "diverged": 0, "n": 5}
    eleven = Regret.of(0.1 * i for i in range(11))
    assert (eleven.median, eleven.p90, eleven.max) == (0.5, 0.9, 1.0), "where q falls on a run"


@pytest.mark.parametrize("n", [1, 2, 3, 10, 100])
def test_a_quantile_is_a_run_and_not_too_small(n: int) -> None:
    """At least the share q of the runs has no more regret, and no smaller run has so many below it
    that it lies at q or beyond by linear interpolation.
    """
    regrets = np.random.default_rng(n).random(n)
    answer = Regret.of(regrets)
    for q, value in ((0.5, answer.median), (0.9, answer.p90), (1.0, answer.max)):
        assert value in regrets
        assert np.mean(regrets <= value) >= q
        assert value >= np.quantile(regrets, q)
        smaller = regrets[regrets < value]
        assert not len(smaller) or smaller.max() <= np.quantile(regrets, q)


@pytest.mark.parametrize(
    ("regrets", "median", "diverged"),
    [
        ([0.1, None, 0.3], 0.3, 1),
        ([None, None, 0.7], None, 2),
        ([0.1, np.inf, 0.3, np.nan, 0.2], 0.3, 2),
        ([None, None], None, 2),
        ([], None, 0),
        ([0.0, 0.0], 0.0, 0),
    ],
)
def test_runs_that_failed_count_as_infinite(
    regrets: list[float | None], median: float | None, diverged: int
) -> None:
    answer = Regret.of(regrets).as_json()
    assert answer["diverged"] == diverged
    assert answer["median"] == median
    assert (answer["max"] is None) == (diverged > 0 or not regrets)
    assert ("note" in answer) == (answer["max"] is None), "what is null has a note"
    if diverged:
        assert f"{diverged} of {len(regrets)} runs ended early" in answer["note"]


def test_regret_of_one_run() -> None:
    assert regret(2.5, 2.0) == 0.25
    assert regret(np.inf, 2.0) == np.inf
    assert regret(None, 2.0) is regret(2.0, None) is None
    assert regret(0.0, 0.0) is None, "at the station nothing is to be gained"


def test_game_cost_of_a_run_and_of_its_record() -> None:
    """The integral of the local cost and ζ(T)'P ζ(T); a run that ended early costs infinitely much."""
    scenario = quick_scenario("simulation.duration=0.4")
    P = scenario.station_keeping().problem.P
    history = run(scenario)
    record = to_dataset(history, {"mode": "game"})
    end = record["zeta"].values[-1]
    expected = cost_to_date(record)[-1] + end @ P @ end
    assert game_cost(history, P) == game_cost(record, P) == pytest.approx(expected, rel=1e-15)
    history.stopped = "the state left chi"
    assert game_cost(history, P) == game_cost(to_dataset(history, {}), P) == np.inf


def test_a_problem_that_is_no_vehicle() -> None:
    """The two-state game along its optimum, V* = x_1^2 / 2 + x_2^2: no regret, and no thrusters."""
    start, gamma = np.array([0.8, -1.0]), 2.0

    def flow(t: float, x: Array) -> list[float]:
        c = np.cos(2.0 * x[0]) + 2.0
        u_control, u_disturbance = -c * x[1], c * x[1] / gamma**2
        k = 1.0 - gamma**-2
        drift = -x[0] / 2.0 - x[1] / 2.0 * (1.0 - k * c**2)
        spent = x[0] ** 2 + x[1] ** 2 + u_control**2
        attenuated = gamma**2 * u_disturbance**2
        return [x[1] - x[0], drift + c * (u_control + u_disturbance), spent, attenuated]

    times = np.linspace(0.0, 2.0, 21)
    x = solve_ivp(flow, (0.0, 2.0), [*start, 0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12).y.T
    record = xr.Dataset(
        {
            "zeta": (("time", "state"), x[:, :2]),
            "cost": ("time", x[:, 2]),
            "attenuated": ("time", x[:, 3]),
        },
        {"time": times},
        {"stopped": "", "mode": "game"},
    )
    problem, basis, _ = two_state()
    setup = Setup(problem=problem, basis=basis, envelope=np.ones(2), compiled=False)
    value = start[0] ** 2 / 2.0 + start[1] ** 2
    metrics = run_metrics(record, setup, value)
    assert metrics.cost == pytest.approx(value, rel=1e-8)
    assert metrics.regret == pytest.approx(0.0, abs=1e-8)
    assert metrics.cost == game_cost(record, problem.P)
    assert metrics.rest_share == pytest.approx((x[-1, 0] ** 2 / 2.0 + x[-1, 1] ** 2) / value, rel=1e-7)
    for name in ("position_rms", "excursion", "effort", "energy", "saturated", "peak_thrust"):
        assert getattr(metrics, name) is None, name
    assert run_metrics(record, setup, value / 2.0).regret == pytest.approx(1.0)
    assert QuickValue(setup.problem)(start) == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize(("zeta", "value"), [(FAR_STATE, FAR_VALUE), (FAST_STATE, FAST_VALUE)])
def test_error_of_the_value(zeta: Array, value: float) -> None:
    """A fast state is the harder one: its velocities change sign nine times within the mesh."""
    problem, meshes = quick_scenario().setup().problem, (MeshSettings.quick, MeshSettings.fine)
    errors = [abs(QuickValue(problem, mesh)(zeta) / value - 1.0) for mesh in meshes]
    assert errors[0] < 4e-6
    assert errors[1] < 8e-7
    assert errors[1] < errors[0]


def test_the_last_value_is_remembered() -> None:
    value = QuickValue(quick_scenario().station_keeping().problem)
    zeta = quick_scenario().initial_state
    found = value.solution(zeta)
    assert value.solution(zeta.copy()) is found
    other = value(0.5 * zeta)
    assert other < found.value
    assert value(zeta) == found.value, "from a fresh start, whatever came before"


def test_the_optimum_has_no_regret_against_itself() -> None:
    """Its cost in the game, by its own quadrature and with ζ(T)'P ζ(T), is its value."""
    record = optimum()
    P = quick_scenario().station_keeping().problem.P
    end = record["zeta"].values[-1]
    value = record.attrs["value"]
    assert (record["cost"].values[-1] + end @ P @ end - value) / value == pytest.approx(0.0, abs=1e-8)


def test_the_optimum_is_the_cheapest() -> None:
    """The linear policy from the same state, run long enough, costs more than the optimum."""
    scenario = quick_scenario("simulation.duration=40")
    station = scenario.station_keeping()
    value = optimum().attrs["value"]
    record = online_record(scenario, policy=lambda: linear_on(station), kind="linear")
    metrics = run_metrics(record, station, value)
    assert metrics.stopped is None
    assert metrics.regret is not None
    assert 0.009 < metrics.regret < 0.011
    assert metrics.cost == pytest.approx((1.0 + metrics.regret) * value)


def test_cost_is_the_integral_of_the_local_cost() -> None:
    """ζ'Qζ + u_1'R u_1 - γ^2 u_2'W_d u_2 by the trapezoidal rule, holds of 0.02 s."""
    record, game = learned(), quick_scenario().station_keeping().game
    zeta, u_control = record["zeta"].values, record["u_control"].values
    local = game.local_cost(zeta, u_control, record["u_disturbance"].values)
    expected = trapezoid(local, record["time"].values)
    assert cost_to_date(record)[-1] == pytest.approx(expected, rel=0.02)
    assert np.all(np.diff(record["cost"].values) > 0.0)


def test_cost_of_a_disturbed_run_has_no_credit_for_the_disturbance() -> None:
    record = disturbed()
    np.testing.assert_array_equal(cost_to_date(record), record["cost"].values)
    assert record["attenuated"].values[-1] > 0.0
    assert cost_to_date(learned())[-1] < learned()["cost"].values[-1]


def test_a_run_that_ended_early_has_no_cost() -> None:
    record = learned().assign_attrs(stopped="the state left chi at t = 2.00 s")
    metrics = run_metrics(record, quick_scenario().station_keeping(), 100.0)
    assert metrics.cost is None
    assert metrics.regret is None
    assert metrics.stopped == "the state left chi at t = 2.00 s"
    assert np.isfinite(metrics.position_rms)


def test_dissipation_from_rest() -> None:
    """From V(0) = 0 the L2 gain is below γ: what is spent and stored is less than γ^2 ∫ d'W_d d."""
    record, station = disturbed(), quick_scenario().station_keeping()
    assert record.attrs["stopped"] == ""
    value, zeta = QuickValue(station.problem), record["zeta"].values
    assert value(zeta[0]) == 0.0
    margin = dissipation_margin(record, 0.0, value(zeta[-1]))
    assert margin > 0.0
    game = station.game
    zeta, u, d = (record[name].values for name in ("zeta", "u_control", "u_disturbance"))
    spent = np.sum((zeta @ game.Q) * zeta, axis=1) + np.sum((u @ game.R) * u, axis=1)
    supplied = game.gamma**2 * np.sum((d @ game.W_d) * d, axis=1)
    expected = trapezoid(supplied - spent, record["time"].values) - value(zeta[-1])
    assert margin == pytest.approx(expected, rel=0.02)
    assert np.abs(zeta[-1]).max() > 0.01, "the force must have moved the vehicle"


def test_dissipation_from_a_state() -> None:
    """With the certified value of the start the gain of the linear policy holds too."""
    force = "simulation.disturbance.force=[1,0,0,0,0,0]"
    scenario = quick_scenario(*DISTURBED, force, "simulation.duration=10")
    station = scenario.station_keeping()
    record = online_record(scenario, policy=lambda: linear_on(station), kind="linear")
    start = float(optimum().attrs["value"])
    assert QuickValue(station.problem)(scenario.initial_state) == pytest.approx(start, rel=1e-5)
    end = QuickValue(station.problem)(record["zeta"].values[-1])
    margin = dissipation_margin(record, start, end)
    assert margin > 0.0
    assert dissipation_margin(record, start + 1.0, end) - margin == pytest.approx(1.0)
    assert record["attenuated"].values[-1] == pytest.approx(40.0)  # γ^2 d^2 T = 4 · 1 N^2 · 10 s


def test_the_disturbance_of_a_constant_force_is_that_force() -> None:
    """d of the record is J^-T τ_d in the earth frame: what was set, at every time."""
    force = np.array([2, -1, 1, 0.05, -0.05, 0.1])
    np.testing.assert_allclose(disturbed()["u_disturbance"].values, np.tile(force, (151, 1)), atol=1e-9)


def radau_trajectory(mesh: Array, degree: int) -> Trajectory:
    nodes = np.array(collocation_points(degree, "radau"))
    times = np.append(mesh[0], (mesh[:-1, None] + np.diff(mesh)[:, None] * nodes).ravel())
    n_points = len(times) - 1
    return Trajectory(mesh, times, np.zeros((n_points + 1, 1)), np.zeros((n_points, 1)), degree)


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 7])
def test_quadrature_of_polynomials_is_exact(degree: int) -> None:
    mesh = np.array([0.0, 0.3, 1.0, 2.5])
    path = radau_trajectory(mesh, degree)
    coefficients = np.random.default_rng(degree).standard_normal(degree)
    exact = np.polyint(coefficients)
    got = path.quadrature(np.polyval(coefficients, path.times[1:]))
    expected = np.polyval(exact, path.times) - np.polyval(exact, 0.0)
    np.testing.assert_allclose(got, expected, atol=1e-12)


def test_quadrature_of_a_smooth_function_against_scipy() -> None:
    def wave(t: float) -> float:
        return float(np.exp(-0.3 * t) * np.cos(2.0 * t) + 0.1 * t)

    path = radau_trajectory(np.linspace(0.0, 6.0, 25), 5)
    got = path.quadrature(np.array([wave(t) for t in path.times[1:]]))
    for i in (0, 1, 37, 80, 120):
        expected, _ = quad(wave, 0.0, path.times[i], epsabs=1e-13, epsrel=1e-13)
        assert got[i] == pytest.approx(expected, abs=1e-7)


def test_quadrature_at_mesh_points_has_the_higher_order() -> None:
    """Radau quadrature of degree d integrates polynomials of degree 2d - 2 exactly over intervals."""
    path = radau_trajectory(np.array([0.0, 0.7, 2.0]), 3)
    got = path.quadrature(path.times[1:] ** 4)[[3, 6]]
    np.testing.assert_allclose(got, np.array([0.7, 2.0]) ** 5 / 5.0, rtol=1e-12)


def test_peak_thrust() -> None:
    vehicle = Vehicle.load("bluerov2-heavy")
    assert vehicle.thrusters is not None
    heave = np.zeros((3, 6))
    heave[:, 2] = [10.0, -103.0, 0.0]  # four vertical thrusters share it: 25.75 N each, forward
    assert peak_thrust(heave, vehicle) == pytest.approx(25.75 / 51.5)
    heave[1, 2] = 103.0  # and 25.75 N each in reverse, of 39.9 N
    assert peak_thrust(heave, vehicle) == pytest.approx(25.75 / 39.9)
    assert peak_thrust(heave, Vehicle.load("rexrov")) is None


def test_position_and_effort() -> None:
    record = learned()
    metrics = run_metrics(record, quick_scenario().station_keeping(), None)
    distance = np.linalg.norm(record["zeta"].values[:, :3], axis=1)
    assert metrics.position_rms == pytest.approx(np.sqrt(np.mean(distance**2)))
    force = np.linalg.norm(record["tau_b"].values[:, :3], axis=1)
    assert metrics.effort == pytest.approx(trapezoid(force**2, record["time"].values))
    assert metrics.regret is None


def test_energy_of_a_constant_thrust() -> None:
    """Full power at either limit, 385 W each; a quarter of the thrust takes an eighth of it."""
    thrust = np.tile([51.5, -39.9, 51.5 / 4, -39.9 / 4, 0, 0, 0, 0], (11, 1))
    time = 0.5 * np.arange(11)
    record = xr.Dataset({"thrust": (("time", "thruster"), thrust)}, {"time": time})
    vehicle = Vehicle.load("bluerov2-heavy")
    assert energy(record, vehicle) == pytest.approx(385.0 * (1 + 1 + 1 / 8 + 1 / 8) * 5.0)
    heave = np.zeros((11, 6))
    heave[:, 2] = -4 * 51.5 / 4
    record = xr.Dataset({"tau_b": (("time", "force"), heave)}, {"time": time})
    assert energy(record, vehicle) == pytest.approx(4 * 385.0 / 8 * 5.0)
    assert energy(record, Vehicle.load("rexrov")) is None


def test_excursion_and_the_time_of_a_step() -> None:
    metrics = run_metrics(learned(), quick_scenario().station_keeping(), None)
    start = quick_scenario().initial_state[:3]
    assert metrics.excursion == pytest.approx(np.linalg.norm(start), rel=1e-3)
    assert 0.0 < metrics.policy_microseconds < metrics.policy_mean
    assert metrics.saturated is None
