"""The value of the nonlinear game against the attenuation level γ, from a state.

V falls as γ grows, to the optimal-control value without disturbance as γ -> infinity, with

    dV/dγ = -2 γ times the integral of u_2'W_d u_2

by the envelope theorem. Saddle points are found from γ = infinity downwards, each started from the
one before. Towards γ* the closed loop gets slower without bound, so the horizon follows it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ...symbolic import InputError, Problem, RunError
from ...symbolic.arrays import Array
from ...symbolic.game import gamma_threshold
from ..limits import LimitError, Limits, limited
from ..path import MeshSettings
from ..settings import OfflineSettings, horizon_of
from .saddle import SaddleSolution, SaddleSolver

# time constants of the slowest mode within the horizon; what is left is of third order, e^-30
HORIZON = 10.0


@dataclass(frozen=True)
class GammaPoint:
    """One point of the curve.

    Attributes
    ----------
    gamma : γ [-]
    value : V(ζ), NaN if there is a fault
    linear_value : ζ'P ζ of the linearised game
    slope : dV/dγ
    fault : why no saddle point was found, or nothing
    """

    gamma: float
    value: float
    linear_value: float
    slope: float
    fault: str = ""


@dataclass(frozen=True)
class GammaCurve:
    """The value from one state against γ.

    Attributes
    ----------
    zeta : (n,) initial state
    gamma_star : γ* of the linearised game [-]
    points : with γ ascending
    undisturbed : the limit γ = infinity, an optimal control problem
    """

    zeta: Array
    gamma_star: float
    points: list[GammaPoint]
    undisturbed: GammaPoint

    @property
    def faults(self) -> list[str]:
        """What is wrong with the curve, in words: points not found, a value that rises with γ."""
        points = [*self.points, self.undisturbed]
        found = [point for point in points if not point.fault]
        return [f"gamma = {point.gamma:g}: {point.fault}" for point in points if point.fault] + [
            f"the value rises from gamma = {left.gamma:g} to {right.gamma:g}"
            for left, right in pairwise(found)
            if right.value > left.value * (1.0 + 1e-9)
        ]


class GammaCurveSolver:
    """Curves of one problem from many states.

    Parameters
    ----------
    problem : the game on its plant; its own γ plays no part
    gammas : finite levels; None for 12 whose distances to the threshold grow geometrically
    horizon : T [s] at least; longer where the closed loop is slow
    compiled : as for the saddle solver
    limits : of one curve; the levels that are left then are faults

    Raises
    ------
    InputError
        If a level is not finite or does not exceed the threshold of R_eff > 0; the message names γ*.
    """

    def __init__(
        self,
        problem: Problem,
        gammas: Sequence[float] | None = None,
        *,
        horizon: float = MeshSettings.saddle.horizon,
        compiled: bool = True,
        limits: Limits | None = None,
    ) -> None:
        self.problem = problem
        self.limits = Limits() if limits is None else limits
        levels = default_gammas(problem) if gammas is None else sorted({float(g) for g in gammas})
        if not levels or not np.all(np.isfinite(levels)):
            raise InputError("give at least one level of gamma, each a finite number")
        self._undisturbed = SaddleSolver(problem.with_gamma(np.inf), horizon=horizon, compiled=compiled)
        self._solvers = [self._undisturbed.with_gamma(gamma) for gamma in levels]

    def solve(self, zeta0: Array) -> GammaCurve:
        """Return the curve from `zeta0`; a level without saddle point is a fault of its point.

        Near half a turn each point is that of the cheaper turn; see `Angles`.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        """
        starts = self.problem.starts(zeta0)
        with limited(self.limits):
            curves = [self._from(start) for start in starts]
        points, limits = (list(each) for each in zip(*curves, strict=True))
        least = [min(turns, key=_value) for turns in zip(*points, strict=True)]
        return GammaCurve(starts[0], self.problem.gamma_star, least, min(limits, key=_value))

    def _from(self, zeta0: Array) -> tuple[list[GammaPoint], GammaPoint]:
        """Return the points from one way to write a state, γ ascending, and their limit."""
        undisturbed, start = self._point(self._undisturbed, zeta0, None)
        points = []
        for solver in reversed(self._solvers):
            point, found = self._point(solver, zeta0, start)
            points.append(point)
            start = found or start
        return points[::-1], undisturbed

    def _point(
        self, solver: SaddleSolver, zeta0: Array, start: SaddleSolution | None
    ) -> tuple[GammaPoint, SaddleSolution | None]:
        problem = solver.problem
        gamma, linear = float(problem.game.gamma), float(zeta0 @ problem.P @ zeta0)
        slow = solver.with_horizon(max(solver.settings.horizon, HORIZON / problem.decay_rate))
        try:
            solution, _ = slow.solve_aligned(zeta0, start=start)
        except (RunError, LimitError) as error:
            return GammaPoint(gamma, np.nan, linear, np.nan, str(error)), None
        return GammaPoint(gamma, solution.value, linear, solution.slope), solution


def _value(point: GammaPoint) -> float:
    """Return what points of several turns are compared by: the value, infinite where there is none."""
    return float(np.inf if point.fault else point.value)


def default_gammas(problem: Problem) -> list[float]:
    """Return 12 levels from 1.05 to 10 times the threshold of R_eff > 0, denser towards it."""
    threshold = gamma_threshold(problem.game.R, problem.game.W_d)
    return [float(threshold * (1.0 + x)) for x in np.geomspace(0.05, 9.0, 12)]


def gamma_curve(
    problem: Problem,
    zeta0: ArrayLike,
    gammas: Sequence[float] | None = None,
    settings: OfflineSettings | None = None,
) -> GammaCurve:
    """Return the curve of a game from one state; `GammaCurveSolver` is for many states.

    Parameters
    ----------
    problem : the game on its plant; its own γ plays a part in the horizon alone
    zeta0 : (n,) initial state
    gammas : finite levels; None for 12 whose distances to the threshold grow geometrically
    settings : of the certified solve, whose horizon the curve shares

    Raises
    ------
    InputError
        As `GammaCurveSolver` and its `solve`.
    """
    asked = OfflineSettings() if settings is None else settings
    horizon = horizon_of(problem, asked)
    solver = GammaCurveSolver(problem, gammas, horizon=horizon, limits=asked.limits)
    return solver.solve(problem.initial_state(zeta0))
