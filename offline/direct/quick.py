"""The value of a game where it is wanted often, and no certificate with it."""

from __future__ import annotations

from ...symbolic import Problem
from ...symbolic.arrays import Array
from ..path import MeshSettings
from .direct import DirectSolution, DirectSolver


class QuickValue:
    """V* of a game at any state by one direct solve, to about 1e-6 of itself.

    Parameters
    ----------
    problem : the game on its plant
    settings : of the mesh, which sets the error
    """

    def __init__(self, problem: Problem, settings: MeshSettings = MeshSettings.quick) -> None:
        self._solver = DirectSolver(problem, settings)

    def __call__(self, zeta: Array) -> float:
        """Return V*(ζ), ζ (n,); raises as `solution`."""
        return self.with_costate(zeta)[0]

    def with_costate(self, zeta: Array) -> tuple[float, Array]:
        """Return V*(ζ) and its gradient, (n,); raises as `solution`."""
        found = self.solution(zeta)
        return found.value, found.costate

    def solution(self, zeta: Array) -> DirectSolution:
        """Return the solve behind V*(ζ), not re-integrated.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        RunError
            If the solver does not converge.
        """
        return self._solver.solve(zeta, verify=False)
