"""The controller a user steps: stations and headings, trim, learning periods, input that is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.online import Controller
from stationkeep.online.loop import PlantState
from stationkeep.online.vehicle import HeldPlant
from stationkeep.online.vehicle.disturbance import Force
from stationkeep.symbolic import InputError

from .games import QUICK, Array, quick_scenario

ETA = np.array([0.4, -0.2, 0.3, 0.08, -0.05, 0.2])
ETA_DOT = np.array([0.05, -0.02, 0.03, 0.02, -0.04, 0.06])


def controller(station: tuple[float, float, float, float] = (0, 0, 0, 0), **more: bool) -> Controller:
    return Controller(quick_scenario(), station, **more)


def turned(
    eta: Array, eta_dot: Array, station: tuple[float, float, float, float]
) -> tuple[Array, Array]:
    """Return the pose and rate that look from `station` as these do from the origin, north ahead."""
    x, y, z, psi = station
    c, s = np.cos(psi), np.sin(psi)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    pose = np.concatenate([turn @ eta[:3] + [x, y, z], eta[3:5], [eta[5] + psi]])
    return pose, np.concatenate([turn @ eta_dot[:3], eta_dot[3:]])


STATIONS = [(3.0, -7.0, 12.0, 0.0), (0.0, 0.0, 0.0, 1.1), (-40.0, 25.0, 8.0, -2.9)]


@pytest.mark.parametrize("station", STATIONS)
def test_behaviour_is_the_same_at_every_station_and_heading(
    station: tuple[float, float, float, float],
) -> None:
    """The same body wrench and the same learning along a path that is moved and turned."""
    at_origin, elsewhere = controller(), controller(station)
    for i in range(30):
        eta, eta_dot = ETA * np.exp(-0.1 * i), ETA_DOT * np.exp(-0.1 * i)
        tau_b = at_origin.step(eta, eta_dot, 0.05)
        np.testing.assert_allclose(
            elsewhere.step(*turned(eta, eta_dot, station), 0.05), tau_b, atol=1e-7
        )
        np.testing.assert_allclose(elsewhere.zeta, at_origin.zeta, atol=1e-12)
    critics = at_origin.learner.critic, elsewhere.learner.critic
    np.testing.assert_allclose(critics[0], critics[1], atol=1e-6 * np.linalg.norm(critics[0]))
    assert np.linalg.norm(critics[0] - at_origin.setup.riccati_weights) > 1.0


def test_wrench_depends_on_the_heading_error() -> None:
    """So that the comparison above can fail."""
    held = controller(learn=False)
    first = held.step(ETA, ETA_DOT, 0.05)
    yawed = ETA + np.array([0, 0, 0, 0, 0, 0.3])
    assert np.abs(held.step(yawed, ETA_DOT, 0.05) - first).max() > 0.1


@pytest.mark.parametrize("turns", [-3, -1, 1, 2])
def test_yaw_error_is_wrapped(turns: int) -> None:
    held = controller((0, 0, 0, 3.0), learn=False)
    eta = np.array([0, 0, 0, 0, 0, -3.0])
    tau_b = held.step(eta, np.zeros(6), 0.05)
    assert held.zeta[5] == pytest.approx(2.0 * np.pi - 6.0)
    eta[5] += 2.0 * np.pi * turns
    np.testing.assert_allclose(held.step(eta, np.zeros(6), 0.05), tau_b, atol=1e-9)


def test_force_is_the_linear_policy_without_learning() -> None:
    held = controller(learn=False)
    tau_b = held.step(ETA, ETA_DOT, 0.05)
    zeta = np.append(ETA, ETA_DOT)
    setup, game = held.setup, held.setup.game
    g = setup.model.input_matrix(zeta)
    u_1 = -game.R_inverse @ g.T @ setup.problem.P @ zeta
    (J,) = setup.model.kinematics(ETA)
    np.testing.assert_allclose(held.u_control, u_1, rtol=1e-7)
    np.testing.assert_allclose(held.u_disturbance, -u_1 / game.gamma**2, rtol=1e-7)
    np.testing.assert_allclose(tau_b, J.T @ u_1, rtol=1e-7)
    np.testing.assert_allclose(held.body_wrench(u_1), J.T @ u_1, rtol=1e-12)


def test_no_learning_keeps_the_weights() -> None:
    held = controller(learn=False)
    start = held.learner.critic.copy()
    for _ in range(20):
        held.step(ETA, ETA_DOT, 0.25)
        assert held.last_step is None
    np.testing.assert_array_equal(held.learner.critic, start)


@pytest.fixture(scope="module")
def heavy() -> Scenario:
    """The vehicle as published, 0.98 N heavier than the water it displaces."""
    buoyant = [*QUICK, 'vehicle="bluerov2-heavy-buoyant"']
    return Scenario.load("bluerov2-heavy", buoyant)


@pytest.mark.parametrize("heading", [0.0, 1.2])
def test_heavy_vehicle_at_its_station_gets_its_trim_and_stays(heavy: Scenario, heading: float) -> None:
    held = Controller(heavy, (0.0, 0.0, 5.0, heading))
    at_rest = np.array([0.0, 0.0, 5.0, 0.0, 0.0, heading])
    tau_b = held.step(at_rest, np.zeros(6), 0.02)
    (J,) = held.setup.model.kinematics(np.zeros(6))
    np.testing.assert_allclose(tau_b, J.T @ held.setup.model.u_trim, atol=1e-12)
    np.testing.assert_allclose(tau_b, [0.0, 0.0, -0.98, 0.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_array_equal(held.u_control, np.zeros(6))
    plant = HeldPlant(held.setup, Force(np.zeros(6), 0.0, 0.0))
    end = plant.advance(0.0, PlantState(np.zeros(12), 0.0, 0.0), tau_b, np.zeros(6), 30.0)
    np.testing.assert_allclose(end.zeta, 0.0, atol=1e-10)
    assert end.cost < 1e-15
    sunk = PlantState(np.zeros(12), 0.0, 0.0)
    for i in range(20):
        sunk = plant.advance(0.5 * i, sunk, np.zeros(6), np.zeros(6), 0.5)
    assert sunk.zeta[2] > 0.1


def test_trim_is_not_paid_for(heavy: Scenario) -> None:
    held = Controller(heavy, learn=False)
    held.step(ETA, ETA_DOT, 0.02)
    tau_b = held.body_wrench(held.u_control + held.setup.model.u_trim)
    plant = HeldPlant(held.setup, Force(np.zeros(6), 0.0, 0.0))
    _, u_control, d = plant.rates(0.0, np.append(ETA, ETA_DOT), tau_b, np.zeros(6))
    np.testing.assert_allclose(u_control, held.u_control, atol=1e-10)
    np.testing.assert_allclose(d, 0.0, atol=1e-10)


@pytest.mark.parametrize(("dt", "every"), [(0.25, 1), (0.05, 5), (0.02, 13), (0.1, 3), (0.4, 1)])
def test_learns_once_its_period_has_passed(dt: float, every: int) -> None:
    """At once, then every 0.25 s; a dt that does not divide it is followed by the next call."""
    learner = controller()
    assert learner.learned.period == 0.25
    learned = []
    for i in range(1, 40):
        before = learner.learner.critic
        learner.step(ETA * 0.9**i, ETA_DOT * 0.9**i, dt)
        moved = not np.array_equal(before, learner.learner.critic)
        assert moved == (learner.last_step is not None)
        if moved:
            learned.append(i)
    assert learned == list(range(1, 40, every))


def test_dt_may_change_from_call_to_call() -> None:
    learner = controller()
    learned = []
    for dt in (0.1, 0.1, 0.04, 0.02, 0.2, 0.05, 0.3):
        learner.step(ETA, ETA_DOT, dt)
        learned.append(learner.last_step is not None)
    assert learned == [True, False, False, False, True, False, True]


BAD: dict[str, Callable[[Controller], object]] = {
    "dt zero": lambda c: c.step(ETA, ETA_DOT, 0.0),
    "dt negative": lambda c: c.step(ETA, ETA_DOT, -0.02),
    "dt NaN": lambda c: c.step(ETA, ETA_DOT, float("nan")),
    "dt infinite": lambda c: c.step(ETA, ETA_DOT, float("inf")),
    "NaN in eta": lambda c: c.step(np.where(np.arange(6) == 2, np.nan, ETA), ETA_DOT, 0.02),
    "inf in eta_dot": lambda c: c.step(ETA, np.where(np.arange(6) == 2, np.inf, ETA_DOT), 0.02),
    "NaN yaw": lambda c: c.step(np.where(np.arange(6) == 5, np.nan, ETA), ETA_DOT, 0.02),
    "five entries": lambda c: c.step(ETA[:5], ETA_DOT, 0.02),
    "twelve entries": lambda c: c.step(np.append(ETA, ETA_DOT), ETA_DOT, 0.02),
    "a column": lambda c: c.step(ETA[:, None], ETA_DOT, 0.02),
    "nothing": lambda c: c.step([], [], 0.02),
    "a ragged list": lambda c: c.step([[1.0, 2.0], [3.0]], ETA_DOT, 0.02),  # type: ignore[list-item]
    "words": lambda c: c.step(["x"] * 6, ETA_DOT, 0.02),
    "pitched up": lambda c: c.step([0, 0, 0, 0, np.pi / 2, 0], ETA_DOT, 0.02),
    "pitched down": lambda c: c.step([0, 0, 0, 0, -1.7, 0], ETA_DOT, 0.02),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_measurements_are_refused_and_change_nothing(
    name: str, one_sentence: Callable[[BaseException], str]
) -> None:
    held = controller()
    held.step(ETA, ETA_DOT, 0.25)
    before = held.learner.critic.copy(), held.zeta.copy(), held.u_control.copy()
    with pytest.raises(InputError) as caught:
        BAD[name](held)
    one_sentence(caught.value)
    after = held.learner.critic, held.zeta, held.u_control
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(old, new)
    assert np.all(np.isfinite(held.step(ETA, ETA_DOT, 0.25)))


@pytest.mark.parametrize(
    "station", [(0.0, 0.0, 5.0), (0.0, 0.0, 5.0, 0.0, 1.0), (0.0, float("nan"), 0.0, 0.0)]
)
def test_bad_stations_are_refused(
    station: tuple[float, ...], one_sentence: Callable[[BaseException], str]
) -> None:
    with pytest.raises(InputError, match="four finite numbers") as caught:
        Controller(quick_scenario(), station)  # type: ignore[arg-type]
    one_sentence(caught.value)


def test_known_current_and_a_heading_do_not_go_together(
    one_sentence: Callable[[BaseException], str],
) -> None:
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, "current=[0.2, 0.0, 0.0]"])
    with pytest.raises(InputError, match="turn the earth frame") as caught:
        Controller(scenario, (0.0, 0.0, 0.0, 0.5))
    one_sentence(caught.value)
    held = Controller(scenario, (0.0, 0.0, 5.0, 0.0), learn=False)
    tau_b = held.step([0, 0, 5, 0, 0, 0], np.zeros(6), 0.02)
    assert tau_b[0] == pytest.approx(-(141.0 * 0.04 + 13.7 * 0.2), rel=1e-9)
