"""What a scenario of a problem without a vehicle has where it says nothing.

The shipped settings are those of the BlueROV2 Heavy, whose slowest mode decays at 0.117 1/s. For
another problem every time is measured in that decay: with τ = 0.117 / (its decay rate) times are
multiplied by τ and gains divided by it. What follows the fastest mode instead, the control period and
the number of steps of a prediction, is taken from that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...online import LearnerSettings, SimulationSettings
from ...online.learning import PERIOD
from ...symbolic import Problem

DECAY = 0.117  # 1/s, of the slowest mode of the shipped game
HELD = 0.03  # a control period times the fastest mode, so that the hold costs about 1e-4 of the optimum
STABLE = 2.0  # the longest step of a prediction times the fastest mode; Runge-Kutta ends at 2.8


def problem_defaults(problem: Problem) -> dict[str, dict[str, Any]]:
    """Return groups of settings that fit the time scales of a problem."""
    shipped, loop = LearnerSettings(), SimulationSettings()
    tau = DECAY / problem.decay_rate
    fastest = problem.fastest_rate
    period = _rounded(HELD / fastest)
    learning = period * max(round(PERIOD * tau / period), 1)
    horizon = _rounded(shipped.horizon * tau)
    longest = 5.0 / 3.0 * horizon * fastest / STABLE  # steps whose last is 5/3 of their mean
    return {
        "basis": {"name": "quadratic"},
        "learner": {
            "horizon": horizon,
            "steps": int(np.clip(math.ceil(longest), shipped.steps, 2000)),
            "period": learning,
            "gain_critic": _rounded(shipped.gain_critic / tau),
            "gain_actor_1": _rounded(shipped.gain_actor_1 / tau),
            "gain_actor_2": _rounded(shipped.gain_actor_2 / tau),
            "forgetting": min(_rounded(shipped.forgetting / tau), 0.99 / learning),
        },
        "simulation": {
            "duration": period * math.ceil(loop.duration * tau / period),
            "control_period": period,
            "monitor_period": max(_rounded(loop.monitor_period * tau), period),
        },
    }


def _rounded(value: float) -> float:
    """Return a value to two digits."""
    return float(f"{value:.2g}")
