"""LQR, cascaded PID and model predictive control against scipy, the optimum and a constant current."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from stationkeep.comparison.policies import LQR, LinearPolicy, OnVehicle
from stationkeep.comparison.policies.mpc import ModelPredictive, PredictionSettings
from stationkeep.comparison.policies.pid import CascadedPID, CascadeSettings
from stationkeep.offline import DirectSolver
from stationkeep.online import Feedback, run
from stationkeep.symbolic import InputError, RunError, StationKeeping

from .games import Array, linear_on, quick_scenario

NEAR = np.array([0.2, -0.1, 0.15, 0.05, -0.03, 0.1, 0.02, -0.03, 0.05, 0.01, 0.02, -0.02])
CURRENT = (
    "simulation.mode=disturbed",
    "simulation.disturbance.kind=current",
    "simulation.disturbance.velocity=[0.2, 0.1, 0.05]",
    "simulation.initial_state=[0,0,0,0,0,0,0,0,0,0,0,0]",
    "simulation.control_period=0.1",
)


def step(policy: Feedback, zeta: Array, dt: float = 0.02) -> Array:
    """Return the wrench of a policy on the quick scenario's vehicle."""
    return OnVehicle(policy, quick_scenario().station_keeping()).step(zeta[:6], zeta[6:], dt)


def made(kind: type[Feedback], station: StationKeeping) -> Feedback:
    return CascadedPID(station) if kind is CascadedPID else kind(station.problem)


def test_lqr_has_the_gain_of_scipys_riccati_equation() -> None:
    station = quick_scenario().station_keeping()
    B = np.vstack([np.zeros((6, 6)), np.linalg.inv(station.model.vehicle.M)])
    A, R = station.problem.linearization[0], station.game.R
    expected = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, station.game.Q, R))
    policy = LQR(station.problem)
    np.testing.assert_allclose(policy.gain, expected, rtol=1e-6, atol=1e-8)
    assert np.abs(policy.gain - LinearPolicy(station.problem).gain).max() > 0.1


@pytest.mark.parametrize("kind", [LQR, LinearPolicy, CascadedPID])
def test_the_answer_makes_the_cost_that_of_the_single_player(kind: type[Feedback]) -> None:
    """u_1'R u_1 - γ^2 u_2'W_d u_2 = v'R_eff v with v = u_1 + u_2, from the definitions."""
    station = quick_scenario("game.W_d=[2, 3, 1.5, 20, 15, 12]").station_keeping()
    policy, game = made(kind, station), station.game
    step(policy, NEAR)
    u_1, u_2 = policy.u_control, policy.u_disturbance
    R_eff = np.linalg.inv(np.linalg.inv(game.R) - np.linalg.inv(game.W_d) / game.gamma**2)
    v = u_1 + u_2
    paid = u_1 @ game.R @ u_1 - game.gamma**2 * u_2 @ game.W_d @ u_2
    assert paid == pytest.approx(v @ R_eff @ v)
    np.testing.assert_allclose(v, np.linalg.solve(R_eff, game.R @ u_1))


@pytest.mark.parametrize("kind", [LQR, CascadedPID, ModelPredictive])
def test_a_full_turn_of_yaw_changes_nothing(kind: type[Feedback]) -> None:
    station = quick_scenario().station_keeping()
    turned = NEAR + 2.0 * np.pi * np.eye(12)[5]
    np.testing.assert_allclose(
        step(made(kind, station), turned), step(made(kind, station), NEAR), atol=1e-7
    )


def test_long_horizon_is_the_optimal_policy() -> None:
    """60 s ahead, u_1 is that of the offline optimum's costate, found on another mesh."""
    station = quick_scenario().station_keeping()
    optimum = DirectSolver(station.problem, horizon=80.0, n_intervals=40, degree=5)
    expected = optimum.solve(NEAR, verify=False)
    settings = PredictionSettings(horizon=60.0, intervals=24, degree=6, grading=6.0)
    policy = ModelPredictive(station.problem, settings)
    step(policy, NEAR)
    np.testing.assert_allclose(policy.u_control, expected.u_control, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(policy.u_disturbance, expected.u_disturbance, rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_longer_horizons_are_better_than_the_linear_policy() -> None:
    """One more second takes part of the excess away; both are above the optimum, below linear."""
    scenario = quick_scenario("simulation.duration=40")
    station = scenario.station_keeping()
    value = (
        DirectSolver(station.problem, horizon=80.0).solve(scenario.initial_state, verify=False).value
    )
    regrets = []
    for policy in (
        ModelPredictive(station.problem, PredictionSettings(horizon=4.0)),
        ModelPredictive(station.problem, PredictionSettings(horizon=2.0)),
        LinearPolicy(station.problem),
    ):
        history = run(scenario, OnVehicle(policy, station))
        rest = history.zeta[-1] @ station.problem.P @ history.zeta[-1]
        regrets.append((history.cost[-1] - history.attenuated[-1] + rest) / value - 1.0)
    assert 0.0 < regrets[0] < 0.5 * regrets[1] < 0.5 * regrets[2]


def test_failed_solves_are_counted_and_the_plan_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    station = quick_scenario().station_keeping()
    policy = ModelPredictive(station.problem, PredictionSettings(horizon=0.5, period=0.1))
    first = step(policy, NEAR, 0.1)

    def fail(*arguments: object, **settings: object) -> None:
        raise RunError("no convergence")

    monkeypatch.setattr(policy._newton, "solve", fail)
    for i in range(4):
        step(policy, NEAR, 0.1)
        assert policy.failures == i + 1
        assert np.abs(policy.u_control - LinearPolicy(station.problem).control(NEAR, 0.1)).max() > 1e-3
    step(policy, NEAR, 0.1)  # the plan of 0.5 s has ended
    np.testing.assert_allclose(
        policy.u_control, LinearPolicy(station.problem).control(NEAR, 0.1), rtol=1e-9
    )
    assert (policy.solves, policy.failures) == (6, 5)
    assert np.all(np.isfinite(first))


def test_predictions_need_positive_settings() -> None:
    with pytest.raises(InputError, match="must be positive"):
        PredictionSettings(horizon=-1.0)


def test_pid_gains_follow_from_inertia_and_bandwidth() -> None:
    """Surge of the BlueROV2: M = 13.5 + 6.36 kg, ω_o = 0.25, ω_v = 1 and ω_i = 0.0625 rad/s."""
    policy = CascadedPID(quick_scenario().station_keeping())
    assert policy.proportional[0] == pytest.approx(19.86)
    assert policy.integral[0] == pytest.approx(19.86 / 16.0)
    tau = step(policy, np.array([0.4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]))
    assert tau[0] == pytest.approx(-19.86 * 0.1)


def test_pid_limits_its_set_points() -> None:
    policy = CascadedPID(quick_scenario().station_keeping())
    tau = step(policy, np.array([100.0, 0, 0, 0, 0, 0, -0.5, 0, 0, 0, 0, 0]))
    np.testing.assert_allclose(tau, 0.0, atol=1e-12)  # the vehicle comes back at the limit already


def test_pid_has_no_steady_error_in_a_current_and_the_linear_policy_has() -> None:
    """The integral carries the drag; proportional feedback needs an error of drag over stiffness."""
    scenario = quick_scenario(*CURRENT, "simulation.duration=300")
    station = scenario.station_keeping()
    settings = CascadeSettings(integral=0.5)
    held = run(scenario, OnVehicle(CascadedPID(station, settings), station))
    assert held.stopped is None
    assert np.abs(held.zeta[-1]).max() < 1e-4
    leaning = run(scenario, linear_on(station))
    assert leaning.stopped is None
    assert leaning.zeta[-1][0] > 0.5


@pytest.mark.slow
def test_pid_does_not_wind_up() -> None:
    """Held back with a demand beyond the thrusters, the integral stays; it decays with the error."""
    station = quick_scenario().station_keeping()
    settings = CascadeSettings(position=5.0, speed=2.0)
    policy, far = CascadedPID(station, settings), 10.0 * np.eye(12)[0]
    for _ in range(500):
        tau = step(policy, far, 0.1)
    thrusters = station.model.vehicle.thrusters
    assert thrusters is not None
    reach = np.abs(thrusters.matrix[0]).sum() * 51.5
    assert tau[0] < -reach  # it asks for more all the time
    free = CascadedPID(station, CascadeSettings(position=5.0, speed=2.0))
    free.limits = np.array([np.full(6, -np.inf), np.full(6, np.inf)])
    for _ in range(500):
        unbounded = step(free, far, 0.1)
    assert np.abs(unbounded[0]) > 10.0 * np.abs(tau[0])
