"""CasADi's Opti stack as its users write direct collocation: Radau, expanded, IPOPT's defaults."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import DM, Opti
from stationkeep.symbolic import Problem

from .game import LinearGuess, Mesh, Solve, point_function


def build(problem: Problem, mesh: Mesh) -> Solve:
    """Return a solve by the function that Opti makes of the program."""
    n, k, d = problem.n_states, problem.n_inputs, mesh.degree
    nodes = casadi.collocation_points(d, "radau")
    derivative, _, weights = casadi.collocation_coeff(nodes)
    point = point_function(problem)
    opti = Opti()
    zeta0 = opti.parameter(n)
    start = end = opti.variable(n)
    opti.subject_to(start == zeta0)
    cost, all_states, all_inputs = 0.0, [], []
    for h in np.diff(mesh.points):
        states, inputs = opti.variable(n, d), opti.variable(k, d)
        slopes = casadi.horzcat(end, states) @ derivative
        for j in range(d):
            rate, running = point(states[:, j], inputs[:, j])
            opti.subject_to(slopes[:, j] == h * rate)
            cost += h * weights[j] * running
        end = states[:, -1]
        all_states.append(states)
        all_inputs.append(inputs)
    opti.minimize(cost + end.T @ DM(problem.P) @ end)
    opti.solver("ipopt", {"expand": True, "print_time": False}, {"print_level": 0, "sb": "yes"})
    guessed = [zeta0, start, casadi.horzcat(*all_states), casadi.horzcat(*all_inputs)]
    program = opti.to_function("solve", guessed, [opti.f])
    guess = LinearGuess(problem, mesh.times(np.array(nodes)))

    def solve(zeta0: np.ndarray) -> float:
        first_states, first_inputs = guess(zeta0)
        return float(program(zeta0, zeta0, first_states.T, first_inputs.T))

    return solve
