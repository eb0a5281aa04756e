"""The value of a game where it is wanted often, and no certificate with it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ...symbolic import Problem
from ...symbolic.arrays import Array
from ..limits import Limits, limited
from ..path import MeshSettings
from .direct import DirectSolution, DirectSolver
from .extremals import by_turns

QUICK = Limits(max_iterations=1000, max_seconds=60.0, name="QuickValue")


class QuickValue:
    """V* of a game at any state by one direct solve, to about 1e-6 of itself.

    Angles are taken the short way, and near half a turn both turns are solved; see `Angles`.

    From 24 states each of the shipped vehicles' envelopes at s = 0.35 and 1 it is within 3.4e-6 of the
    certified value (median 1.7e-7 at most), with `MeshSettings.fine` within 7e-7 (median 4e-8).

    Parameters
    ----------
    problem : the game on its plant
    settings : of the mesh, which sets the error; made to suit the closed loop of the problem
    limits : of one solve

    Attributes
    ----------
    error : largest relative error of a value, with room
    """

    error: ClassVar[float] = 5e-6

    def __init__(
        self,
        problem: Problem,
        settings: MeshSettings = MeshSettings.quick,
        limits: Limits = QUICK,
    ) -> None:
        self._limits = limits
        self._solver = DirectSolver(problem, settings.suited(problem))
        self._last: tuple[bytes, DirectSolution] | None = None

    def __call__(self, zeta: Array) -> float:
        """Return V*(ζ), ζ (n,); raises as `solution`."""
        return self.with_costate(zeta)[0]

    def with_costate(self, zeta: Array) -> tuple[float, Array]:
        """Return V*(ζ) and its gradient, (n,); raises as `solution`."""
        found = self.solution(zeta)
        return found.value, found.costate

    def solution(self, zeta: Array) -> DirectSolution:
        """Return the solve behind V*(ζ), not re-integrated.

        The last one is remembered: all policies of a comparison start from the same states.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        RunError
            If the solver does not converge, within its limits.
        """
        key = np.asarray(zeta, dtype=float).tobytes()
        if self._last is None or self._last[0] != key:
            with limited(self._limits):
                self._last = key, self._cheapest(zeta)
        return self._last[1]

    def _cheapest(self, zeta: Array) -> DirectSolution:
        """Return the cheapest solve of the turns from which the value may be least."""
        solver = self._solver
        starts = solver.problem.starts(zeta)
        found = by_turns(starts, lambda start: solver.solve(start, verify=False))
        return min(found, key=lambda solution: solution.value)
