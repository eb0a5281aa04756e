"""Thrust allocation against optimality conditions and scipy's general solver; limits in a run."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize
from stationkeep.online import Allocator, run, to_dataset
from stationkeep.online.vehicle.allocation import RIDGE
from stationkeep.symbolic import InputError, RunError, Vehicle

from .games import Array, quick_scenario

LOW, HIGH = -39.9, 51.5
REACH = np.array([250.0, 250.0, 350.0, 70.0, 40.0, 65.0])
LIMITS = "simulation.thruster_limits=true"


def allocator() -> Allocator:
    return Allocator(Vehicle.load("bluerov2-heavy"))


def objective(thrust: Array, tau: Array) -> float:
    """|S (B T - τ)|^2 + ε |T / 51.5|^2 with S the reciprocal of what an axis alone can do."""
    thrusters = Vehicle.load("bluerov2-heavy").thrusters
    assert thrusters is not None
    B = thrusters.matrix
    error = (B @ thrust - tau) / (HIGH * np.abs(B).sum(axis=1))
    return float(error @ error + RIDGE * np.sum((thrust / HIGH) ** 2))


def test_within_the_limits_it_is_the_least_norm() -> None:
    vehicle, rng = Vehicle.load("bluerov2-heavy"), np.random.default_rng(2)
    thrusters = vehicle.thrusters
    assert thrusters is not None
    for tau in rng.uniform(-0.1, 0.1, (20, 6)) * REACH:
        given = allocator().allocate(tau)
        assert not given.saturated
        np.testing.assert_allclose(thrusters.matrix @ given.thrust, tau, atol=1e-10)
        np.testing.assert_allclose(given.thrust, thrusters.thrust(tau), atol=1e-10)


def test_optimality_conditions_of_the_constrained_problem() -> None:
    """The gradient vanishes at free thrusts, and points outwards at those on a limit."""
    rng, saturated = np.random.default_rng(3), 0
    allocate = allocator()
    for tau in rng.uniform(-1.0, 1.0, (200, 6)) * REACH:
        given = allocate.allocate(tau)
        T = given.thrust
        assert LOW <= T.min() <= T.max() <= HIGH
        np.testing.assert_allclose(given.wrench, allocate.matrix @ T, atol=1e-10)
        if not given.saturated:
            continue
        saturated += 1
        error = allocate.scale * (given.wrench - tau)
        gradient = 2.0 * (allocate.matrix.T @ (allocate.scale * error) + RIDGE * T / HIGH**2)
        size = np.abs(allocate.scale[:, None] * allocate.matrix).max() * np.linalg.norm(error) + 1e-9
        assert np.abs(gradient[(T > LOW) & (T < HIGH)]).max(initial=0.0) < 1e-9 * size + 1e-12
        assert gradient[T == LOW].min(initial=0.0) >= 0.0
        assert gradient[T == HIGH].max(initial=0.0) <= 0.0
    assert saturated > 150


@pytest.mark.parametrize("seed", range(3))
def test_no_worse_than_a_general_solver(seed: int) -> None:
    tau = np.random.default_rng(seed).uniform(-1.5, 1.5, 6) * REACH
    given = allocator().allocate(tau)
    assert given.saturated
    bounds = [(LOW, HIGH)] * 8
    other = minimize(objective, np.zeros(8), (tau,), "L-BFGS-B", bounds=bounds, tol=1e-14)
    assert objective(given.thrust, tau) <= other.fun * (1.0 + 1e-9)
    assert objective(given.thrust, tau) == pytest.approx(other.fun, rel=1e-4)


def test_a_wrench_that_other_thrusts_can_give_is_given() -> None:
    """Surge by (44, 44, -44, -44) N is beyond reverse, but 5 N more on all four is the same wrench."""
    allocate = allocator()
    within = np.array([49.0, 49, -39, -39, 0, 0, 0, 0])
    tau = allocate.matrix @ within
    given = allocate.allocate(tau)
    assert given.saturated
    np.testing.assert_allclose(given.wrench, tau, atol=1e-4)
    assert np.linalg.norm(given.thrust) <= np.linalg.norm(within)


def test_needs_thrusters_and_a_finite_wrench(one_sentence: Callable[[BaseException], str]) -> None:
    with pytest.raises(InputError, match="no thruster layout") as caught:
        run(quick_scenario("vehicle=rexrov", LIMITS))
    one_sentence(caught.value)
    with pytest.raises(RunError, match="not finite"):
        allocator().allocate(np.full(6, np.nan))


class Pushing:
    """Asks for a constant wrench."""

    u_disturbance = np.zeros(6)

    def __init__(self, wrench: Array) -> None:
        self.wrench = wrench

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        return self.wrench

    def body_wrench(self, u: Array) -> Array:
        return u


@pytest.mark.parametrize(("factor", "share"), [(0.01, 0.0), (1.0, 1.0)])
def test_the_plant_gets_what_the_thrusters_give(factor: float, share: float) -> None:
    scenario = quick_scenario(LIMITS, "simulation.duration=0.2", "simulation.mode=disturbed")
    wanted = factor * np.array([400.0, 0, 0, 0, 0, 0])
    history = run(scenario, Pushing(wanted))
    record = to_dataset(history, {})
    assert record.attrs["saturated"] == share
    assert record["thrust"].dims == ("time", "thruster")
    assert record["thrust"].attrs["units"] == "N"
    B = allocator().matrix
    np.testing.assert_allclose(record["thrust"].values @ B.T, record["tau_b"].values, atol=1e-9)
    assert LOW <= record["thrust"].values.min() <= record["thrust"].values.max() <= HIGH
    # the vehicle accelerates as under the wrench it got: M_11 = 13.5 + 6.36 kg
    limited = min(wanted[0], record["tau_b"].values[0, 0])
    free = run(
        quick_scenario("simulation.duration=0.2", "simulation.mode=disturbed"),
        Pushing(record["tau_b"].values[0]),
    )
    np.testing.assert_allclose(free.zeta[-1], history.zeta[-1], atol=1e-9)
    assert limited < 0.75 * 400.0


def test_without_limits_there_is_no_thrust_in_the_record() -> None:
    record = to_dataset(run(quick_scenario("simulation.duration=0.1")), {})
    assert "thrust" not in record
    assert "saturated" not in record.attrs
    assert record.attrs["policy_microseconds_mean"] > 0.0
