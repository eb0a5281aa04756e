"""The worst disturbance against a policy whose weights change in time, u_1 = π(ζ, W(t)).

    max over d of  ∫_0^T ζ'Qζ + π'R π - γ^2 d'W_d d dt + ζ(T)'P ζ(T),    π = -1/2 R^-1 g'σ'W(t)

with weights that are constant between given times, as a learner leaves them behind. One piece is a
policy whose weights are frozen. After T both players go on optimally, so that the figure is not above
the worst case of any policy that follows the schedule up to T.

The disturbance knows the schedule from the start, and the schedule takes no notice of it. A learner
does: under another disturbance it would have left another schedule. So for a policy that adapts this
figure is neither a lower nor an upper bound of the worst case. What is a lower bound is the cost of any
disturbance played against the learner itself; where the schedule that it leaves then has that very
disturbance as its worst, both figures are the same.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from typing import Unpack

import numpy as np
from casadi import SX

from ...symbolic import Basis, InputError, Problem, RunError
from ...symbolic.arrays import Array
from ..direct import against_control
from ..limits import EndedByLimitError, Limits, limited
from ..path import MeshChanges, MeshSettings, Trajectory, aligned_mesh
from .disturber import Disturber
from .policy import learned_policy
from .worst_case import WorstCase, measured, unbounded


@dataclass(frozen=True, eq=False)
class WeightSchedule:
    """Weights that are constant between given times.

    Attributes
    ----------
    times : (S,) from which each row holds [s], the first 0, ascending
    weights : (S, m)

    Raises
    ------
    InputError
        If the times do not start at 0 or do not ascend, or the shapes disagree.
    """

    times: Array
    weights: Array

    def __post_init__(self) -> None:
        if self.weights.ndim != 2 or self.times.shape != (len(self.weights),) or not self.times.size:
            raise InputError(
                f"a schedule needs a row of weights for each time, but has shapes {self.times.shape} "
                f"and {self.weights.shape}"
            )
        if self.times[0] != 0.0 or not np.all(np.diff(self.times) > 0.0):
            raise InputError("the times of a schedule must start at 0 and ascend")

    @classmethod
    def constant(cls, weights: Array) -> WeightSchedule:
        """Return the schedule of one piece, weights (m,)."""
        return cls(np.zeros(1), np.array(weights)[None, :])

    @property
    def jumps(self) -> Array:
        """Times at which the weights do change [s]."""
        changed = np.any(np.diff(self.weights, axis=0) != 0.0, axis=1)
        return np.asarray(self.times[1:][changed])

    def at(self, times: Array) -> Array:
        """Return the weights at times >= 0, (len, m); at a jump the later ones."""
        rows = np.searchsorted(self.times, times, side="right") - 1
        return np.asarray(self.weights[rows])

    def by_interval(self, mesh: Array) -> Array:
        """Return the weights on the intervals of a mesh that has a point at every jump, (K, m)."""
        return self.at(0.5 * (mesh[:-1] + mesh[1:]))


class ScheduledWorstCase:
    """Worst cases of (14) with the weights of schedules, from many states.

    The weights are parameters of the program: the derivatives are compiled once.

    Parameters
    ----------
    problem, basis : of the policy
    settings : of the mesh, before the jumps are put in, and its Radau points
    starts, seed, reach, limits : as for `WorstCaseSolver`
    changes : single settings of the mesh
    """

    def __init__(
        self,
        problem: Problem,
        basis: Basis,
        settings: MeshSettings | None = None,
        *,
        starts: int = 2,
        seed: int = 0,
        reach: float = 4.0,
        limits: Limits | None = None,
        **changes: Unpack[MeshChanges],
    ) -> None:
        self.problem, self.basis = problem, basis
        self.limits = Limits() if limits is None else limits
        suited = MeshSettings.direct.suited(problem) if settings is None else settings
        settings = suited.changed(**changes)
        self._mesh = settings.points
        weights = SX.sym("weights", basis.n_basis)
        policy = learned_policy(problem, basis, weights)
        stage = against_control(problem, policy, weights, problem.P)
        self._disturber = Disturber(
            problem, stage, settings.degree, starts=starts, seed=seed, reach=reach, patience=40
        )

    def solve(
        self, zeta0: Array, schedule: WeightSchedule, tries: Iterable[Trajectory] = ()
    ) -> WorstCase:
        """Return the worst case from `zeta0`, or that there is none and why.

        Parameters
        ----------
        tries : trajectories to start from too

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain, or the schedule has not as many
            weights as the basis.
        """
        started, disturber = time.perf_counter(), self._disturber
        zeta0 = self.problem.require_state(zeta0)
        given, needed = schedule.weights.shape[1], self.basis.n_basis
        if given != needed:
            raise InputError(f"the schedule has {given} weights, but the basis has {needed}")
        jumps = schedule.jumps[schedule.jumps < self._mesh[-1]]
        mesh = aligned_mesh(self._mesh, jumps)
        times = disturber.times(mesh)
        drawn = disturber.guesses(zeta0, mesh, lambda t: schedule.at(np.array([t]))[0])
        guesses = chain(drawn, (path.sample(times) for path in tries))
        try:
            with limited(self.limits):
                response = disturber.maximise(zeta0, mesh, guesses, schedule.by_interval, fixed=jumps)
                return measured(disturber, zeta0, response, schedule.by_interval, started)
        except EndedByLimitError as error:
            reason = f"no worst case was found: {error}"
            return unbounded(zeta0, reason, time.perf_counter() - started, ended=True)
        except RunError as error:
            reason = f"the disturbance runs off: {error}"
            return unbounded(zeta0, reason, time.perf_counter() - started)
