"""Games with a known answer, and a small scenario of the shipped one that compiles in seconds.

Each is built once a run, when a test first asks for it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from stationkeep.comparison import Scenario
from stationkeep.comparison.policies import LinearPolicy, OnVehicle
from stationkeep.online import LearnerSettings
from stationkeep.symbolic import (
    Basis,
    Game,
    Model,
    Problem,
    StationKeeping,
    ValueFunctions,
    Vehicle,
    quadratic,
    two_state_game,
)

Array = NDArray[np.float64]

TWO_STATE_WEIGHTS = np.array([0.5, 0.0, 1.0])  # V* = ζ_1^2 / 2 + ζ_2^2
HALF_WIDTHS = np.array([2, 2, 2, 0.4, 0.4, 1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5])
FAR_STATE = np.array([2, -1, 1, 0.3, -0.2, 1, 0, 0, 0, 0, 0, 0], dtype=float)
FAR_VALUE = 1222.42214664
"""V(FAR_STATE) of the shipped game: 80 and 120 aligned intervals and re-integration agree to 1e-11."""
FAST_STATE = HALF_WIDTHS * np.random.default_rng(11).uniform(-1.0, 1.0, 12)
"""A state of the envelope that moves: its velocities change sign nine times on the way home."""
FAST_VALUE = 713.74262704
"""V(FAST_STATE), agreed on likewise."""

QUICK = ("samples.number=200", "basis.name=quadratic", "simulation.duration=2")


@cache
def two_state() -> tuple[Problem, Basis, ValueFunctions]:
    """The exact two-state game (R = 1, γ = 2) and its monomials, not scaled: W* = (1/2, 0, 1)."""
    problem = two_state_game()
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.ones(2))
    return problem, basis, ValueFunctions(problem, basis, compiled=False)


@cache
def linear_quadratic() -> tuple[Problem, Basis, ValueFunctions]:
    """The shipped game on a BlueROV2 Heavy without drag, linearised: V* = ζ'P ζ in 12 states."""
    vehicle = Vehicle.load("bluerov2-heavy").model_copy(
        update={"linear_damping": [0.0] * 6, "quadratic_damping": [0.0] * 6}
    )
    Q = 20.0 / np.array([1, 1, 1, 0.2, 0.2, 0.3, 1, 1, 1, 1, 1, 1]) ** 2
    R = np.array([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])
    problem = Model(vehicle, compiled=False).problem(Game(Q, R, R, 2.0), HALF_WIDTHS).linearized()
    basis = Basis.build("quadratic", quadratic, problem.zeta, HALF_WIDTHS)
    return problem, basis, ValueFunctions(problem, basis, compiled=False)


@cache
def quick_scenario(*overrides: str) -> Scenario:
    """The shipped scenario with 78 functions, 200 samples and 2 s, and other settings on request.

    Overrides that leave vehicle, game, envelope and basis alone share what is compiled.
    """
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, *overrides])
    parts = {override.partition(".")[0] for override in overrides}
    if overrides and parts <= {"learner", "samples", "simulation"}:
        scenario.__dict__["_station_keeping"] = quick_scenario().station_keeping()
    return scenario


def plain(**changes: object) -> LearnerSettings:
    """Least squares on the Bellman error's rows as printed, without leash and safeguard."""
    return LearnerSettings.as_printed(**{"rule": "least_squares", "forgetting": 2.0, **changes})


def random_weights(seed: int, m: int) -> tuple[Array, Array, Array]:
    """Return seeded critic and actor weights, all different."""
    critic, actor_1, actor_2 = np.random.default_rng(seed).standard_normal((3, m))
    return critic, actor_1, actor_2


def linear_on(station: StationKeeping) -> OnVehicle:
    """Return the linear H-infinity policy of a vehicle's game, driving the vehicle."""
    return OnVehicle(LinearPolicy(station.problem), station)
