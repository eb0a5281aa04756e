"""The linear policy and the wrench limits against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from scipy.spatial.transform import Rotation
from stationkeep.comparison.report.vehicle_figures import wrench_limits
from stationkeep.symbolic import StationKeeping, Thrusters, Vehicle

from .games import Array, linear_on, quick_scenario


def riccati(station: StationKeeping) -> tuple[Array, Array]:
    """Return B = (0, M^-1) and P of the single-player equivalent, by scipy."""
    M = station.model.vehicle.M
    B = np.vstack([np.zeros((6, 6)), np.linalg.inv(M)])
    A = station.problem.linearization[0]
    R, W_d, gamma = station.game.R, station.game.W_d, station.game.gamma
    R_eff = np.linalg.inv(np.linalg.inv(R) - np.linalg.inv(W_d) / gamma**2)
    return B, solve_continuous_are(A, B, station.game.Q, R_eff)


def euler_jacobian(eta: Array) -> Array:
    """Return J(η) of (1) from scipy's rotation and the textbook matrix of Euler rates."""
    phi, theta, psi = eta[3:]
    J = np.zeros((6, 6))
    J[:3, :3] = Rotation.from_euler("ZYX", [psi, theta, phi]).as_matrix()
    J[3:, 3:] = [
        [1.0, np.sin(phi) * np.tan(theta), np.cos(phi) * np.tan(theta)],
        [0.0, np.cos(phi), -np.sin(phi)],
        [0.0, np.sin(phi) / np.cos(theta), np.cos(phi) / np.cos(theta)],
    ]
    return J


@pytest.mark.parametrize("vehicle", ["bluerov2-heavy", "bluerov2-heavy-buoyant"])
def test_linear_policy(vehicle: str) -> None:
    station = quick_scenario(f"vehicle={vehicle}").station_keeping()
    B, P = riccati(station)
    policy = linear_on(station)
    zeta = np.array([0.7, -0.35, 0.35, 0.1, -0.07, 0.35, 0.1, 0.2, -0.1, 0.05, -0.03, 0.02])
    tau_b = policy.step(zeta[:6], zeta[6:], 0.02)
    expected = -np.linalg.inv(station.game.R) @ B.T @ P @ zeta
    np.testing.assert_allclose(policy.u_control, expected, rtol=1e-6)
    against = np.linalg.inv(station.game.W_d) @ B.T @ P @ zeta / station.game.gamma**2
    np.testing.assert_allclose(policy.u_disturbance, against, rtol=1e-6)
    J = euler_jacobian(zeta[:6])
    trim = np.array([0, 0, station.model.vehicle.buoyancy - station.model.vehicle.weight, 0, 0, 0])
    np.testing.assert_allclose(tau_b, J.T @ (expected + trim), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(policy.body_wrench(expected), J.T @ expected, rtol=1e-12)
    np.testing.assert_array_equal(policy.zeta, zeta)


def test_linear_policy_rests_at_the_station() -> None:
    policy = linear_on(quick_scenario().station_keeping())
    np.testing.assert_array_equal(policy.step(np.zeros(6), np.zeros(6), 0.02), np.zeros(6))


def pairs(allocation: Array, limits: tuple[float, float]) -> Thrusters:
    return Thrusters(allocation=allocation.tolist(), limits=limits)


@pytest.mark.parametrize("axis", range(6))
def test_limits_of_one_thruster_an_axis(axis: int) -> None:
    low, high = wrench_limits(pairs(np.eye(6), (-3.0, 5.0)), axis)
    assert (low, high) == (pytest.approx(-3.0), pytest.approx(5.0))


@pytest.mark.parametrize("axis", range(6))
def test_limits_of_opposed_thrusters(axis: int) -> None:
    """Two that face each other give 5 + 3 N either way, twice that by an arm of 2 m."""
    scale = np.diag([1.0, 1, 1, 2, 2, 2])
    low, high = wrench_limits(pairs(np.hstack([scale, -scale]), (-3.0, 5.0)), axis)
    arm = scale[axis, axis]
    assert (low, high) == (pytest.approx(-8.0 * arm), pytest.approx(8.0 * arm))


def test_limits_with_the_other_axes_at_zero() -> None:
    """A thruster off the axis pushes and turns; the one that stops the turn limits the push."""
    allocation = np.eye(6)
    allocation[5, 0] = 2.0  # the surge thruster's arm for yaw, 2 m
    low, high = wrench_limits(pairs(allocation, (-4.0, 6.0)), 0)
    # yaw: 2 t_1 + t_6 = 0 with -4 <= t_6 <= 6 gives -3 <= t_1 <= 2
    assert (low, high) == (pytest.approx(-3.0), pytest.approx(2.0))


def test_limits_of_the_bluerov2_heavy() -> None:
    thrusters = Vehicle.load("bluerov2-heavy").thrusters
    assert thrusters is not None
    low, high = wrench_limits(thrusters, 2)  # four verticals that push up, z down
    assert (low, high) == (pytest.approx(-4 * 51.5), pytest.approx(4 * 39.9))
    low, high = wrench_limits(thrusters, 0)  # two push and two pull at 45 deg
    assert (low, high) == (pytest.approx(-0.7071 * 2 * 91.4), pytest.approx(0.7071 * 2 * 91.4))
