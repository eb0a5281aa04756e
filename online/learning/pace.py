"""How often the learner has to learn to be in time."""

from __future__ import annotations

import numpy as np
import scipy

from ...symbolic import Problem
from .settings import PERIOD, LearnerSettings

LATE, IN_TIME = 0.16, 0.03  # shares of the cost that is paid within a learning period


def paid_share(problem: Problem, period: float) -> float:
    """Return the share of the cost that is paid within a period [s], under the linear policies.

    1 - E[ζ(T)'P ζ(T)] / E[ζ(0)'P ζ(0)] of the linearised game, for a start that is uniform in the
    envelope: E[ζζ'] is proportional to the squares of its half-widths.
    """
    after = scipy.linalg.expm(problem.closed_loop * period)
    spread = np.diag(problem.scale**2)
    left = float(np.trace(after.T @ problem.P @ after @ spread))
    return 1.0 - left / float(np.trace(problem.P @ spread))


def learning_period(problem: Problem, settings: LearnerSettings) -> float:
    """Return the time between learning steps [s]: what the settings say, or what is in time.

    That is 0.25 s where at most `LATE` of the cost is paid within it. A vehicle that is so quick that
    more of its way is over by then is given a half, a quarter, ... until it is at most `IN_TIME`.
    """
    if settings.period is not None:
        return settings.period
    period = PERIOD
    if paid_share(problem, period) > LATE:
        while paid_share(problem, period) > IN_TIME:
            period /= 2.0
    return period
