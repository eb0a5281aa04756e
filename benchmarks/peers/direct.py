"""stationkeep's own solver, by its structured Newton method or through IPOPT."""

from __future__ import annotations

from stationkeep.offline import DirectSolver
from stationkeep.symbolic import Problem
from stationkeep.symbolic.vehicle import Array

from .game import Mesh, Solve


def newton(problem: Problem, mesh: Mesh) -> Solve:
    """Return the solve of `DirectSolver` by its structured Newton method; IPOPT's help is an error."""
    solver = DirectSolver(
        problem,
        horizon=mesh.horizon,
        n_intervals=mesh.n_intervals,
        degree=mesh.degree,
        grading=mesh.grading,
    )

    def solve(zeta0: Array) -> float:
        solution = solver.solve(zeta0, verify=False)
        if solution.method != "newton":
            raise RuntimeError("Newton's method did not converge")
        return float(solution.value)

    return solve


def ipopt(problem: Problem, mesh: Mesh) -> Solve:
    """Return the solve of `DirectSolver` through IPOPT."""
    solver = DirectSolver(
        problem,
        horizon=mesh.horizon,
        n_intervals=mesh.n_intervals,
        degree=mesh.degree,
        grading=mesh.grading,
        method="ipopt",
    )
    return lambda zeta0: solver.solve(zeta0, verify=False).value
