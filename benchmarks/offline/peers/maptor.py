"""maptor, Radau pseudospectral collocation on a fixed mesh.

maptor has no parameters: a new initial state is a new problem, so every solve transcribes it again.
Its cost is scaled by 1e-3, for it is an unknown of the program.
"""

from __future__ import annotations

import casadi
import maptor
import numpy as np
from stationkeep.symbolic import Problem
from stationkeep.symbolic.arrays import Array

from .game import LinearGuess, Mesh, Solve, point_function

COST_SCALE = 1e3
OPTIONS = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}


def build(problem: Problem, mesh: Mesh) -> Solve:
    """Return a solve that states and transcribes the problem for its initial state."""
    d = mesh.degree
    point = point_function(problem)
    nodes = 1.0 - np.array(casadi.collocation_points(d, "radau"))[::-1]
    at_nodes = LinearGuess(problem, mesh.times(nodes))
    at_points = LinearGuess(problem, mesh.points)

    def solve(zeta0: Array) -> float:
        ocp = maptor.Problem("station keeping")
        phase = ocp.set_phase(1)
        phase.time(initial=0.0, final=mesh.horizon)
        states = [phase.state(f"x{i}", initial=float(value)) for i, value in enumerate(zeta0)]
        inputs = [phase.control(f"v{i}") for i in range(problem.n_inputs)]
        rate, running = point(casadi.vertcat(*states), casadi.vertcat(*inputs))
        phase.dynamics(dict(zip(states, casadi.vertsplit(rate), strict=True)))
        final = casadi.vertcat(*[state.final for state in states])
        rest = final.T @ casadi.DM(problem.P / COST_SCALE) @ final
        ocp.minimize(phase.add_integral(running / COST_SCALE) + rest)
        phase.mesh([d] * mesh.n_intervals, 2.0 * mesh.points / mesh.horizon - 1.0)
        interior, v = at_nodes(zeta0)
        ends = at_points(zeta0)[0]
        here = [slice(i * d, (i + 1) * d) for i in range(mesh.n_intervals)]
        phase.guess(
            states=[np.vstack([interior[s], ends[i + 1]]).T for i, s in enumerate(here)],
            controls=[v[s].T for s in here],
            initial_time=0.0,
            terminal_time=mesh.horizon,
            integrals=float(zeta0 @ problem.P @ zeta0) / COST_SCALE,
        )
        solution = maptor.solve_fixed_mesh(ocp, nlp_options=OPTIONS, show_summary=False)
        if not solution.status["success"]:
            raise RuntimeError(solution.status["message"])
        return COST_SCALE * float(solution.status["objective"])

    return solve
