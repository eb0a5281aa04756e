"""The disturbance observer against its first-order response, drag in closed form and saturation."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.comparison.records import online_record
from stationkeep.online import DisturbanceObserver, run
from stationkeep.symbolic import InputError

from .games import Array, linear_on, quick_scenario

FROM_REST = "simulation.initial_state=[0,0,0,0,0,0,0,0,0,0,0,0]"
FAST = "simulation.initial_state=[1, -1, 1, 0.3, 0.2, 1, 0.3, 0.2, -0.4, 0.4, 0.3, 0.5]"
DISTURBED = ("simulation.mode=disturbed", FROM_REST)
CURRENT = (*DISTURBED, "simulation.disturbance.kind=current", "simulation.control_period=0.1")
OBSERVED = "simulation.observer_bandwidth=0.7"


class Held:
    """Asks for a constant wrench."""

    u_disturbance = np.zeros(6)

    def __init__(self, wrench: Array) -> None:
        self.wrench = wrench

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        return self.wrench

    def body_wrench(self, u: Array) -> Array:
        return np.zeros(6)  # what is estimated is not fed forward


def lag_error(start: str, period: float) -> float:
    """Return the largest error of the estimate of a constant force against d (1 - exp(-ω_o t)) [N]."""
    force = np.array([2, -1, 1, 0.05, -0.05, 0.1])
    push = f"simulation.disturbance={{kind='constant', force={force.tolist()}}}"
    timed = ("simulation.duration=3", f"simulation.control_period={period}")
    scenario = quick_scenario(*DISTURBED, start, push, OBSERVED, *timed)
    history = run(
        scenario,
        linear_on(scenario.station_keeping()),
    )
    lag = 1.0 - np.exp(-0.7 * np.array(history.time))
    return float(np.abs(history.estimate - lag[:, None] * force).max())


def test_a_constant_force_is_estimated_as_a_first_order_lag() -> None:
    """Where the vehicle moves fast the trapezoidal rule shows, at its second order."""
    assert lag_error(FROM_REST, 0.02) < 5e-5
    errors = [lag_error(FAST, period) for period in (0.02, 0.01)]
    assert errors[0] < 3e-3
    assert 3.0 < errors[0] / errors[1] < 5.0


def test_the_estimate_does_not_depend_on_the_policy() -> None:
    """A vehicle that is pushed about is seen to have the same disturbance as one that is left alone."""
    push = "simulation.disturbance={kind='sinusoid', force=[3,-2,1,0.1,0,0.2], frequency=0.2}"
    scenario = quick_scenario(*DISTURBED, push, OBSERVED, "simulation.duration=3")
    pushed, left = (
        np.array(run(scenario, Held(wrench)).estimate)
        for wrench in (np.array([9.0, -5.0, 3.0, 0.3, -0.2, 0.5]), np.zeros(6))
    )
    np.testing.assert_allclose(pushed, left, atol=2e-3)
    assert np.abs(left).max() > 1.0


def test_with_the_observer_the_vehicle_stays_in_a_current() -> None:
    """The estimate ends at the drag of the water, D_l v + D_q |v| v, and the error at 0."""
    flow = "simulation.disturbance.velocity=[0.2, 0.1, 0.05]"
    scenario = quick_scenario(*CURRENT, flow, OBSERVED, "simulation.duration=120")
    station = scenario.station_keeping()
    record = online_record(scenario, policy=lambda: linear_on(station), kind="linear")
    assert np.abs(record["zeta"].values[-1]).max() < 1e-4
    v = np.array([0.2, 0.1, 0.05])
    drag = np.array([13.7, 0.0, 33.0]) * v + np.array([141.0, 217.0, 190.0]) * v**2
    estimate = record["disturbance_estimate"].values[-1]
    np.testing.assert_allclose(estimate[:3], drag, rtol=1e-3)
    np.testing.assert_allclose(estimate, record["u_disturbance"].values[-1], atol=1e-3)
    np.testing.assert_allclose(record["u_control"].values[-1], -estimate, atol=1e-3)
    bare = quick_scenario(*CURRENT, flow, "simulation.duration=120")
    assert run(bare, linear_on(station)).zeta[-1][0] > 0.5


def test_it_does_not_wind_up_where_the_thrusters_give_less() -> None:
    """1.5 m/s take more thrust than there is; what is estimated is still the disturbance alone."""
    flow = "simulation.disturbance.velocity=[1.5, 0, 0]"
    limited = ("simulation.thruster_limits=true", "simulation.chi=100", "simulation.duration=8")
    scenario = quick_scenario(*CURRENT, flow, OBSERVED, *limited, "simulation.control_period=0.02")
    history = run(
        scenario,
        linear_on(scenario.station_keeping()),
    )
    assert history.stopped is None
    assert np.mean(history.saturated) > 0.3
    d, lagged = np.array(history.disturbance), np.zeros((len(history.time), 6))
    for i in range(1, len(d)):  # the lag of the recorded disturbance
        mean = 0.5 * (d[i - 1] + d[i])
        lagged[i] = lagged[i - 1] + (1.0 - np.exp(-0.7 * 0.02)) * (mean - lagged[i - 1])
    np.testing.assert_allclose(np.array(history.estimate), lagged, atol=0.01 * np.abs(d).max())


def test_a_known_current_is_no_disturbance() -> None:
    scenario = quick_scenario(*DISTURBED, "current=[0.2, 0.1, 0]", OBSERVED)
    history = run(
        scenario,
        linear_on(scenario.station_keeping()),
    )
    np.testing.assert_allclose(history.estimate, 0.0, atol=1e-6)


def test_a_step_without_a_wrench_learns_nothing() -> None:
    station = quick_scenario().station_keeping()
    observer, moving = DisturbanceObserver(station, 1.0), np.arange(12.0) / 20.0
    observer.step(np.zeros(12), 0.1)
    np.testing.assert_array_equal(observer.step(moving, 0.1), 0.0)
    observer.applied(np.zeros(6))
    assert np.abs(observer.step(2.0 * moving, 0.1)).max() > 0.1


@pytest.mark.parametrize("bandwidth", [0.0, -1.0, np.nan, np.inf])
def test_the_bandwidth_is_positive(bandwidth: float) -> None:
    with pytest.raises(InputError, match="must be positive, in 1/s"):
        DisturbanceObserver(quick_scenario().station_keeping(), bandwidth)


def test_no_observer_in_the_game() -> None:
    with pytest.raises(InputError, match="would cancel what the disturbance player does"):
        quick_scenario(OBSERVED)
