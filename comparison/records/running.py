"""A scenario in closed loop, of a vehicle or of a problem."""

from __future__ import annotations

from typing import cast

from ...online import History, LearnedPolicy, Policy, VehiclePolicy, run
from ...online.loop import ProblemSystem, Progress, drive, require_held
from ...online.vehicle import require_trim
from ...symbolic import StationKeeping
from ..policies import AnyPolicy
from ..scenario import Scenario


def require_runnable(scenario: Scenario) -> None:
    """Raise InputError where the period can't hold the game, or the thrusters the vehicle."""
    setup = scenario.setup()
    require_held(setup.problem, scenario.simulation.control_period)
    if isinstance(setup, StationKeeping):
        require_trim(setup)


def closed_loop(
    scenario: Scenario, policy: AnyPolicy | None = None, progress: Progress | None = None
) -> History:
    """Run a scenario of a vehicle or of a problem, with its own learner unless a policy is given.

    Raises
    ------
    InputError
        As `require_runnable`.
    """
    require_runnable(scenario)
    if scenario.problem is None:
        return run(scenario, cast("VehiclePolicy | None", policy), progress)
    setup = scenario.setup()
    start = tuple(scenario.initial_state.tolist())
    settings = scenario.simulation.model_copy(update={"initial_state": start})
    system = ProblemSystem(setup.problem, settings, compiled=setup.compiled)
    driven = LearnedPolicy(scenario) if policy is None else cast("Policy", policy)
    return drive(system, driven, scenario, progress)
