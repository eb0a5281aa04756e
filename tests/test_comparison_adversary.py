"""Disturbances of a solved worst case, played in the closed loop."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.offline import ControlPolicy, WorstCaseSolver, linear_policy
from studies.adversary import FrozenPolicy, PlayedForce, WatchedController, play

from .games import linear_on, quick_scenario

ZETA = np.array([0.5, -0.3, 0.2, 0.05, -0.05, 0.2, 0, 0, 0, 0, 0, 0])


@pytest.mark.slow
def test_played_worst_case_costs_what_was_solved_for() -> None:
    """Up to the wrench being held: the difference to the feedback vanishes with the control period."""
    errors = []
    station = quick_scenario().station_keeping()
    problem = station.problem
    worst = WorstCaseSolver(ControlPolicy(problem, linear_policy(problem))).solve(ZETA)
    assert worst.path is not None
    for period in (0.08, 0.02):
        changes = (f"simulation.control_period={period}", "simulation.duration=30")
        scenario = quick_scenario(*changes).with_settings(simulation={"initial_state": tuple(ZETA)})
        played = play(scenario, linear_on(station), worst.path)
        assert played.cost is not None
        errors.append(abs(played.cost / worst.cost - 1.0))
    assert errors[1] < 1e-3
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.slow
def test_played_force_is_the_path_at_its_points_and_zero_afterwards() -> None:
    problem = quick_scenario().station_keeping().problem
    path = WorstCaseSolver(ControlPolicy(problem, linear_policy(problem))).solve(ZETA).path
    assert path is not None
    force = PlayedForce(path)
    scale = np.abs(path.v).max()
    inner = np.arange(len(path.v)) % path.degree != path.degree - 1  # ends belong to two intervals
    for t, v in zip(path.times[1:][inner][::7], path.v[inner][::7], strict=True):
        np.testing.assert_allclose(force.at(t, np.zeros(3)).force, v, atol=1e-9 * scale)
    assert not force.at(path.mesh[-1] + 1.0, np.zeros(3)).force.any()


@pytest.mark.slow
def test_watched_schedule_is_what_the_learner_drove_with() -> None:
    """û_1 of every control step follows from the schedule at that time."""
    scenario = quick_scenario("learner.weights=riccati").with_settings(
        simulation={"initial_state": tuple(ZETA), "duration": 1.0}
    )
    station, controller = scenario.station_keeping(), WatchedController(scenario)
    used = []
    for i in range(40):
        controller.step(ZETA[:6], ZETA[6:], 0.02)
        used.append((0.02 * i, controller.u_control.copy()))
    schedule = controller.schedule
    assert len(schedule.jumps) >= 1
    for t, u_control in used:
        weights = schedule.at(np.array([t + 1e-9]))[0]
        frozen = FrozenPolicy(station, weights)
        frozen.step(ZETA, 0.02)
        np.testing.assert_array_equal(frozen.u_control, u_control)
