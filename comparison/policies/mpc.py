"""Nonlinear model predictive control: the offline optimum over a few seconds, again and again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...offline import MeshSettings, Trajectory
from ...offline.direct import StructuredNewton
from ...offline.path import Grid, graded_mesh
from ...online.loop import Feedback, MeanState
from ...symbolic import InputError, Problem, RunError
from ...symbolic.arrays import Array


@dataclass(frozen=True)
class PredictionSettings:
    """What is predicted, and how often.

    Attributes
    ----------
    horizon : T [s]; after it the cost is ζ(T)'P ζ(T)
    intervals, degree : of the Radau collocation, intervals graded towards the start
    grading : about the logarithm of the ratio of the last to the first interval
    period : time between two solves [s]; in between the plan is followed
    tolerance : relative error at which Newton's method may end
    max_iterations : Newton steps of one solve
    """

    horizon: float = MeshSettings.prediction.horizon
    intervals: int = MeshSettings.prediction.n_intervals
    degree: int = MeshSettings.prediction.degree
    grading: float = MeshSettings.prediction.grading
    period: float = 0.1
    tolerance: float = 1e-5
    max_iterations: int = 15

    def __post_init__(self) -> None:
        least = min(self.horizon, self.intervals, self.degree, self.period, self.tolerance)
        if not (least > 0 and self.max_iterations > 0 and self.grading >= 0.0):
            raise InputError("the settings of the model predictive control must be positive")


class ModelPredictive(Feedback):
    """Receding horizon: min over v of ∫_0^T ζ'Qζ + v'R_eff v + ζ(T)'P ζ(T), u_1 = R^-1 R_eff v.

    Solved by the structured Newton method from the previous plan, shifted by the time that has passed
    and held at its end. A solve that fails leaves the previous plan in force; where there is none, or
    it has ended, the linear H-infinity policy takes its place.

    Attributes
    ----------
    settings : what is predicted
    solves, failures : number of solves, and of those that failed
    """

    def __init__(
        self,
        problem: Problem,
        settings: PredictionSettings | None = None,
        *,
        compiled: bool = True,
    ) -> None:
        super().__init__(problem)
        self.settings = s = PredictionSettings() if settings is None else settings
        self._newton = StructuredNewton(problem, compiled=compiled)
        mesh = graded_mesh(s.horizon, s.intervals, s.grading)
        self._grid = Grid(mesh, s.degree, problem.n_inputs)
        self._linear = problem.linear_gain
        self._mean_state = MeanState(problem)
        self._plan: Trajectory | None = None
        self._age = np.inf  # of the plan [s]
        self._since = np.inf  # the last solve was tried [s]
        self.solves = self.failures = 0

    def control(self, zeta: Array, dt: float) -> Array:
        """Return R^-1 R_eff v of the plan, made anew once the period has passed."""
        zeta = self._mean_state(zeta, dt)
        if self._since >= self.settings.period * (1.0 - 1e-9):
            self._solve(zeta)
            self._since = 0.0
        v = self._linear @ zeta
        if self._plan is not None and self._age < self.settings.horizon:
            v = self._plan.sample(np.array([self._age]))[1][0]
        self._age += dt
        self._since += dt
        return self.problem.game.players(v)[0]

    def _solve(self, zeta: Array) -> None:
        s, grid = self.settings, self._grid
        self.solves += 1
        try:
            found = self._newton.solve(
                zeta, grid, self._guess(zeta), tolerance=s.tolerance, max_iterations=s.max_iterations
            )
        except (RunError, np.linalg.LinAlgError):
            self.failures += 1
            return
        times = np.append(grid.mesh[0], grid.times)
        self._plan = Trajectory(grid.mesh, times, found.states, found.v, grid.degree)
        self._age = 0.0

    def _guess(self, zeta: Array) -> Array:
        """Return the accelerations (K, d, k) of the shifted plan, or of the linear policy."""
        grid = self._grid
        if self._plan is None or self._age >= self.settings.horizon:
            return self._newton.linear_guess(zeta, grid)
        times = np.minimum(grid.times + self._age, self.settings.horizon)
        return self._plan.accelerations(times).reshape(grid.K, grid.degree, grid.k)
