"""An attitude is one thing however it is written: where it enters, in a run, in V*, in a controller."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from casadi import SX
from stationkeep import gamma_curve, saddle_gap, simulate, solve, worst_case
from stationkeep.comparison import Scenario
from stationkeep.comparison.adapters.control import to_control
from stationkeep.comparison.adapters.gym import StationKeepingEnv
from stationkeep.offline import DirectSolver, MeshSettings, QuickValue
from stationkeep.online import Controller, DisturbanceObserver, run
from stationkeep.symbolic import Game, InputError, InverseDynamics, Problem
from stationkeep.symbolic.game import AngleTracker, problem_from_data, problem_to_data
from stationkeep.symbolic.textbook import quadrotor
from stationkeep.symbolic.underwater import ANGLES

from . import fossen
from .commands import call
from .games import Array, linear_on, quick_scenario

TURN = 2.0 * np.pi
YAW = "envelope.half_widths=[2,2,2,0.4,0.4,3.2,0.5,0.5,0.5,0.5,0.5,1.5]"
SPIN = """import json
from pathlib import Path

from stationkeep.symbolic.game import problem_from_data

spin = problem_from_data(json.loads(Path("spin.json").read_text()))
"""
STATE = np.array([0.3, -0.2, 0.4, 0.1, -0.2, 0.5, 0.05, -0.02, 0.03, 0.02, -0.04, 0.06])
MIRROR = np.array([1, 1, 1, 1, -1, 1, 1, 1, 1, 1, -1, 1])


def ways(zeta: Array) -> list[Array]:
    """Return a state by whole turns of each angle, and by (φ + π, π - θ, ψ + π)."""
    angles = np.eye(12)[3:6]
    mirrored = MIRROR * zeta + np.pi * angles.sum(axis=0)
    return [
        *(zeta + n * TURN * angle for n in (-2, -1, 1, 2) for angle in angles),
        zeta + TURN * (angles[0] - angles[2]),
        mirrored,
        mirrored - TURN * angles[1],
    ]


def attitude(zeta: Array) -> tuple[Array, Array]:
    """Return rotation and body rates of a state."""
    return fossen.rotation(zeta[3:6]), fossen.rate_matrix(zeta[3:6]) @ zeta[9:]


@cache
def spin(gamma: float = 2.0) -> Problem:
    """A double integrator that turns: f has every period, and V = ζ'P ζ by each turn."""
    zeta, a = SX.sym("zeta", 2), SX.sym("a")
    game = Game(np.array([4.0, 1.0]), np.array([0.5]), np.array([0.5]), gamma)
    return Problem(
        "spin",
        zeta,
        SX(np.array([[0.0, 1.0], [0.0, 0.0]])) @ zeta,
        SX(np.array([[0.0], [1.0]])),
        game,
        np.array([1.0, 1.0]),
        state_names=("angle", "rate"),
        state_units=("rad", "rad/s"),
        inverse_dynamics=InverseDynamics(a, a),
        periods=(TURN, 0.0),
    )


def test_a_state_keeps_its_attitude_and_is_written_the_short_way() -> None:
    rng = np.random.default_rng(0)
    for zeta in rng.uniform(-7.0, 7.0, (200, 12)):
        short = ANGLES.wrapped(zeta)
        for before, after in zip(attitude(zeta), attitude(short), strict=True):
            np.testing.assert_allclose(after, before, atol=1e-13)
        assert np.abs(short[[3, 5]]).max() <= np.pi
        assert abs(short[4]) <= np.pi / 2
        np.testing.assert_array_equal(np.delete(short, [3, 4, 5, 10]), np.delete(zeta, [3, 4, 5, 10]))


def test_a_short_state_keeps_its_floats() -> None:
    rng = np.random.default_rng(1)
    tracker = AngleTracker(ANGLES)
    for x in rng.uniform(-1.0, 1.0, (200, 12)):
        zeta = x * [9, 9, 9, np.pi, np.pi / 2, np.pi, 9, 9, 9, 9, 9, 9]
        assert ANGLES.wrapped(zeta).tobytes() == zeta.tobytes()
        assert ANGLES.reentered(zeta) is zeta
    for angle in np.linspace(0.0, 3.1, 30):
        zeta = np.full(12, angle) * (np.arange(12) != 4)
        assert tracker.enter(zeta).tobytes() == zeta.tobytes()


@pytest.mark.parametrize("learn", [False, True])
def test_one_attitude_gets_one_wrench(learn: bool) -> None:
    def wrench(zeta: Array) -> Array:
        controller = Controller(quick_scenario(), (0.0, 0.0, 0.0, 1.0), learn=learn)
        return controller.step(zeta[:6], zeta[6:], 0.02)

    expected = wrench(STATE)
    for way in ways(STATE):
        np.testing.assert_allclose(attitude(way)[0], attitude(STATE)[0], atol=1e-14)
        np.testing.assert_allclose(wrench(way), expected, rtol=1e-6, atol=1e-6)


def test_a_roll_of_a_turn_is_no_roll() -> None:
    controller = Controller(quick_scenario(), learn=False)
    wrenches = [controller.step([0, 0, 0, roll, 0, 0], [0.0] * 6, 0.02) for roll in (0.02, 0.02 + TURN)]
    assert abs(wrenches[0][3]) < 1.0
    np.testing.assert_allclose(wrenches[1], wrenches[0], atol=1e-12)


def test_measured_angles_are_one_motion_until_the_way_on_is_the_short_one() -> None:
    """A compass within ±π, a heading to hold of 2 rad; the turn is 1/8 beyond half of one."""
    controller = Controller(quick_scenario(), (0.0, 0.0, 0.0, 2.0), learn=False)

    def seen(heading: float) -> float:
        compass = np.arctan2(np.sin(heading + 2.0), np.cos(heading + 2.0))
        controller.step([0, 0, 0, 0, 0, compass], [0.0] * 6, 0.02)
        return float(controller.zeta[5])

    edge = np.pi + np.pi / 4.0
    for heading in np.arange(0.0, edge, 0.05):
        assert seen(heading) == pytest.approx(heading)
    for heading in (edge + 0.01, edge - 0.05, np.pi, edge + 0.5, TURN + 0.3):
        assert seen(heading) == pytest.approx(heading - TURN)


def test_the_controller_knows_its_pitch_limit(
    one_sentence: Callable[[BaseException], str],
) -> None:
    controller = Controller(quick_scenario(), learn=False)
    held = controller.step([0, 0, 0, 0, np.radians(74.0), 0], [0.0] * 6, 0.02)
    assert np.isfinite(held).all()
    before = controller.zeta
    for degrees in (76.0, 89.0, -80.0, 100.0):
        with pytest.raises(InputError) as error:
            controller.step([0, 0, 0, 0, np.radians(degrees), 0], [0.0] * 6, 0.02)
        assert "pitch" in one_sentence(error.value)
        assert "75 deg" in str(error.value)
    np.testing.assert_array_equal(controller.zeta, before)
    steeper = Controller(quick_scenario("simulation.pitch_limit=85"), learn=False)
    assert np.isfinite(steeper.step([0, 0, 0, 0, np.radians(84.0), 0], [0.0] * 6, 0.02)).all()


def yawed(yaw: float, *more: str) -> Scenario:
    state = f"simulation.initial_state=[0,0,0,0,0,{yaw},0,0,0,0,0,0]"
    return quick_scenario(state, "simulation.duration=12", YAW, *more)


def test_one_pose_has_one_cost() -> None:
    costs = []
    for yaw in (3.2 - TURN, 3.2, 3.2 + TURN):
        scenario = yawed(yaw)
        history = run(scenario, linear_on(scenario.station_keeping()))
        assert history.stopped is None
        assert abs(history.zeta[-1][5]) < 0.1
        costs.append(history.cost[-1])
    assert costs[0] == costs[1] == pytest.approx(2063.0, abs=1.0)
    assert costs[2] == pytest.approx(costs[0], rel=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_near_half_a_turn_chooses_a_turn_and_not_a_cost(seed: int) -> None:
    """Whichever way it goes home, the cost is about that of the quiet run, and it is home."""
    scenario = yawed(3.14, "simulation.noise.attitude=0.05", f"simulation.noise.seed={seed}")
    history = run(scenario, linear_on(scenario.station_keeping()))
    assert history.stopped is None
    assert abs(history.zeta[-1][5]) < 0.3
    assert np.abs(np.diff([zeta[5] for zeta in history.zeta])).max() < 0.1
    assert history.cost[-1] == pytest.approx(2063.0, rel=0.1)


def test_a_run_is_counted_by_the_turn_that_it_took() -> None:
    """A policy that takes its angle within ±π, against the held double integrator in closed form."""
    problem, dt, n = spin(), 0.02, 400
    gain, share = problem.linear_gains[0][0], 1.0 - 0.5 / (4.0 * 0.5)  # v = u_1 + u_2

    def policy(zeta: Array) -> Array:
        return -gain[:1] * np.arctan2(np.sin(zeta[0]), np.cos(zeta[0])) - gain[1:] * zeta[1]

    record = simulate(problem, policy, [3.1, 1.5], n * dt, control_period=dt)
    angle, rate, cost = 3.1 - TURN, 1.5, 0.0
    nodes, weights = np.polynomial.legendre.leggauss(3)
    for i in range(n):
        np.testing.assert_allclose(record["zeta"].values[i], [angle, rate], atol=1e-6)
        u = float(policy(np.array([angle, rate]))[0])
        t, a = 0.5 * dt * (nodes + 1.0), share * u
        local = 4.0 * (angle + rate * t + 0.5 * a * t**2) ** 2 + (rate + a * t) ** 2 + 0.5 * u**2
        cost += 0.5 * dt * float(weights @ local)
        angle, rate = angle + rate * dt + 0.5 * a * dt**2, rate + a * dt
    assert float(record["cost"][-1]) == pytest.approx(cost, rel=1e-6)
    assert float(record["cost"][-1] - record["attenuated"][-1]) > least_of(np.array([3.1, 1.5]))


def least_of(zeta: Array) -> float:
    """Return V* of `spin`: the least of ζ'P ζ over the turns."""
    P, turn = spin().P, np.array([TURN, 0.0])
    return min(float((zeta + n * turn) @ P @ (zeta + n * turn)) for n in range(-3, 4))


STATES = [(3.0, 0.8), (-3.0, -0.8), (3.0, -0.8), (1.0, 6.0), (np.pi, 0.0), (2.9, 0.2), (0.5, 0.1)]


@pytest.mark.parametrize("state", STATES)
def test_the_value_is_the_least_over_the_turns(state: tuple[float, float]) -> None:
    problem, zeta = spin(), np.array(state)
    least = least_of(zeta)
    value = QuickValue(problem)
    for turns in (-2, -1, 0, 1, 2):
        way = zeta + turns * np.array([TURN, 0.0])
        assert value(way) == pytest.approx(least, rel=1e-6)
    optimum = solve(problem, zeta)
    assert optimum.value == pytest.approx(least, rel=1e-7)
    shifted = zeta + np.array(optimum.turns) * np.array([TURN, 0.0])
    assert shifted @ problem.P @ shifted == pytest.approx(least, rel=1e-9)
    np.testing.assert_allclose(optimum.costate, 2.0 * problem.P @ shifted, rtol=1e-5)
    assert optimum.certificate.gradient_unique == (state != (np.pi, 0.0))
    assert not optimum.faults


def test_the_curve_the_gap_and_the_worst_case_start_the_short_way() -> None:
    problem, zeta = spin(), np.array([3.0, 0.8])
    far = zeta + np.array([TURN, 0.0])
    curve = gamma_curve(problem, far, [2.0, 4.0])
    assert curve.points[0].value == pytest.approx(least_of(zeta), rel=1e-7)
    gap = saddle_gap(problem, far)
    assert gap.upper == pytest.approx(least_of(zeta), rel=1e-5)
    assert gap.lower == pytest.approx(least_of(zeta), rel=1e-5)
    worst = worst_case(problem, far)  # the linear policy is the optimal one of its own turn
    assert worst.cost == pytest.approx(zeta @ problem.P @ zeta, rel=1e-5)


def test_the_vehicles_value_by_each_turn() -> None:
    """By hand from both sides; port and starboard are alike, so V* is even about half a turn."""
    problem = quick_scenario().setup().problem
    value, direct = QuickValue(problem), DirectSolver(problem, MeshSettings.quick)
    turn, turning = TURN * np.eye(12)[5], np.eye(12)[11]
    for zeta in (3.0 * np.eye(12)[5], 3.1 * np.eye(12)[5] + turning):
        here, there = (direct.solve(way, verify=False).value for way in (zeta, zeta - turn))
        assert value(zeta) == min(here, there)
        assert value(zeta + turn) == pytest.approx(min(here, there), rel=1e-9)
        assert value(-zeta) == pytest.approx(min(here, there), rel=1e-6)
    assert here > there  # a vehicle that turns goes on


def test_json_says_which_turn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("spin.json").write_text(json.dumps(problem_to_data(spin())), encoding="utf-8")
    Path("spin.py").write_text(SPIN, encoding="utf-8")
    states = ("--state", "3.0,0.8", "--state", f"{0.3 + TURN},0.1")
    rows = call(capsys, "offline", "spin.py:spin", *states, "--json").json()["states"]
    assert [row["turns"] for row in rows] == [{"angle": -1}, {}]
    assert rows[0]["value"] == pytest.approx(least_of(np.array([3.0, 0.8])), rel=1e-7)
    np.testing.assert_allclose(rows[1]["zeta"], [0.3, 0.1], atol=1e-12)


DEGREES = {
    "roll of 18 degrees": ("simulation.initial_state=[0,0,0,18,0,0,0,0,0,0,0,0]", "phi"),
    "yaw of 45 degrees": ("simulation.initial_state=[0,0,0,0,0,45,0,0,0,0,0,0]", "psi"),
    "roll of 10 degrees": ("simulation.initial_state=[0,0,0,10,0,0,0,0,0,0,0,0]", "phi"),
    "pitch of 30 degrees": ("simulation.initial_state=[0,0,0,0,30,0,0,0,0,0,0,0]", "theta"),
}


@pytest.mark.parametrize("name", DEGREES)
def test_degrees_are_told(name: str, one_sentence: Callable[[BaseException], str]) -> None:
    override, state = DEGREES[name]
    with pytest.raises(InputError) as error:
        Scenario.load("bluerov2-heavy", [override])
    text = one_sentence(error.value)
    assert state in text
    assert "angles are in rad" in text


def test_metres_are_not_told_to_be_radians() -> None:
    far = "simulation.initial_state=[90,0,0,0,0,0,0,0,0,0,0,0]"
    with pytest.raises(InputError, match=r"x is 45\.00 half-widths") as error:
        Scenario.load("bluerov2-heavy", [far])
    assert "rad" not in str(error.value)


def test_a_start_is_not_turned_upside_down() -> None:
    """Beyond 90 degrees of pitch the second way is taken where it is upright, else it is refused."""
    problem = quick_scenario().setup().problem
    for way in ways(STATE):
        np.testing.assert_allclose(problem.initial_state(way), STATE, atol=1e-14)
    with pytest.raises(InputError, match=r"pitch is 114\.6 deg"):
        problem.initial_state(2.0 * np.eye(12)[4])


def test_states_given_to_the_solvers_are_looked_at_too() -> None:
    with pytest.raises(InputError, match="angles are in rad"):
        solve(spin(), [90.0, 0.0])


def test_an_environment_sees_one_attitude() -> None:
    env = StationKeepingEnv(quick_scenario())
    seen, _ = env.reset(seed=0, options={"state": STATE})
    for way in ways(STATE):
        np.testing.assert_allclose(env.reset(seed=0, options={"state": way})[0], seen, atol=1e-6)


def test_a_closed_loop_for_other_tools_takes_one_attitude() -> None:
    scenario = quick_scenario()
    system = to_control(scenario, linear_on(scenario.station_keeping()))
    expected = system.output(0.0, STATE, np.zeros(6))[12:]
    for way in ways(STATE):
        np.testing.assert_allclose(system.output(0.0, way, np.zeros(6))[12:], expected, rtol=1e-9)


def test_the_observers_estimate_does_not_hang_on_turns() -> None:
    setup = quick_scenario().station_keeping()
    plain, turned = DisturbanceObserver(setup, 0.7), DisturbanceObserver(setup, 0.7)
    for i in range(6):
        zeta = STATE + 0.01 * i
        turn = TURN * ((i % 2) * np.eye(12)[3] - (i % 3) * np.eye(12)[5])
        expected = plain.step(zeta, 0.02)
        np.testing.assert_allclose(turned.step(zeta + turn, 0.02), expected, atol=1e-8)
        for observer in (plain, turned):
            observer.applied(np.arange(6.0))


def test_a_problem_says_which_states_are_angles() -> None:
    hover = quadrotor()
    np.testing.assert_allclose(hover.initial_state([0, 0, 0.2 + TURN, 0, 0, 0])[2], 0.2)
    assert len(hover.starts([0, 0, 1.5, 0, 0, 30.0])) == 1  # the other turn is outside of the domain
    for problem in (hover, quick_scenario().setup().problem):
        again = problem_from_data(json.loads(json.dumps(problem_to_data(problem))))
        assert again.periods == problem.periods
        assert again.equivalence == problem.equivalence
    assert not spin().linearized().periods


@pytest.mark.parametrize("periods", [(1.0,), (TURN, np.nan), (TURN, -1.0)])
def test_periods_are_one_a_state(
    periods: tuple[float, ...], one_sentence: Callable[[BaseException], str]
) -> None:
    with pytest.raises(InputError) as error:
        replace(spin(), periods=periods)
    assert "2 numbers" in one_sentence(error.value)


def test_a_period_that_is_none_is_refused(one_sentence: Callable[[BaseException], str]) -> None:
    """f of the quadrotor has the sine of its angle in it, g does not stand still in the rate."""
    for i, period in ((2, 3.0), (3, TURN)):
        periods = tuple(period * (np.arange(6) == i))
        with pytest.raises(InputError) as error:
            replace(quadrotor(), periods=periods)
        assert quadrotor().state_names[i] in one_sentence(error.value)
