"""Controls that are held: whether a loop can be held, and what a policy then looks at."""

from __future__ import annotations

from ...symbolic import InputError, Problem
from ...symbolic.arrays import Array
from ...symbolic.game import MEAN_FROM, can_hold, fastest_mode, longest_period, mean_matrix


class MeanState:
    """The mean state of the closed loop over the period for which a control is held.

    ζ itself where the loop is slow against the period, as it is for most vehicles; see
    `symbolic.game.sampled`. The periods are known to two digits, each with a matrix of its own.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._fastest = fastest_mode(problem)[0]
        self._matrices: dict[float, Array] = {}

    def __call__(self, zeta: Array, dt: float) -> Array:
        """Return the mean of the state over dt [s] from ζ on, both (n,)."""
        if self._fastest * dt <= MEAN_FROM:
            return zeta
        period = float(f"{dt:.2g}")
        if period not in self._matrices:
            self._matrices[period] = mean_matrix(self._problem, period)
        return self._matrices[period] @ zeta


def require_held(problem: Problem, period: float) -> None:
    """Raise InputError where a control held for `period` [s] can't keep the linearised game stable.

    The sentence names the fastest mode of the closed loop, the state that it moves, and the period
    that the game needs. A problem without the players' shared input has no such loop to look at.
    """
    if not problem.same_inputs or can_hold(problem, period):
        return
    fastest, state = fastest_mode(problem)
    raise InputError(
        f"{problem.name}: a control period of {period:g} s can't hold this game, whose closed loop has "
        f"a mode at {fastest:.3g} 1/s in {state}; it needs at most "
        f"{longest_period(problem, period):g} s (simulation.control_period), or a game with less gain "
        "there (a larger R or a smaller Q)"
    )
