"""stationkeep's own solver, by its structured Newton method or through IPOPT."""

from __future__ import annotations

from stationkeep.offline import DirectSolver
from stationkeep.offline.settings import Method
from stationkeep.symbolic import Problem
from stationkeep.symbolic.arrays import Array

from .game import Mesh, Solve


def newton(problem: Problem, mesh: Mesh) -> Solve:
    """Return the solve of `DirectSolver` by its structured Newton method; IPOPT's help is an error."""
    return _solve(problem, mesh, "newton")


def ipopt(problem: Problem, mesh: Mesh) -> Solve:
    """Return the solve of `DirectSolver` through IPOPT."""
    return _solve(problem, mesh, "ipopt")


def _solve(problem: Problem, mesh: Mesh, method: Method) -> Solve:
    solver = DirectSolver(problem, mesh, method=method)

    def solve(zeta0: Array) -> float:
        solution = solver.solve(zeta0, verify=False)
        if solution.method != method:
            raise RuntimeError(f"{method} did not converge")
        return float(solution.value)

    return solve
