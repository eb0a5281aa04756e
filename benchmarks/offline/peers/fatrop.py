"""fatrop through CasADi's nlpsol, the structure given by hand: one stage an interval.

The stage's state is ζ at the interval's start, its control all d collocated states and inputs; the
collocation equations are the stage's equality constraints, and the last collocated state is the
next stage's state.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from casadi import DM, MX
from stationkeep.symbolic import Problem

from .game import LinearGuess, Mesh, Solve, point_function


def build(problem: Problem, mesh: Mesh) -> Solve:
    """Return a solve by fatrop on collocation stages."""
    n, k, d, K = problem.n_states, problem.n_inputs, mesh.degree, mesh.n_intervals
    nodes = casadi.collocation_points(d, "radau")
    derivative, _, weights = casadi.collocation_coeff(nodes)
    point = point_function(problem)
    zeta0, starts = MX.sym("zeta0", n), [MX.sym(f"start_{i}", n) for i in range(K + 1)]
    cost, unknowns, constraints = 0.0, [], []
    for i, h in enumerate(np.diff(mesh.points)):
        states, inputs = MX.sym(f"states_{i}", n, d), MX.sym(f"inputs_{i}", k, d)
        slopes = casadi.horzcat(starts[i], states) @ derivative
        unknowns += [starts[i], casadi.vec(states), casadi.vec(inputs)]
        constraints.append(starts[i + 1] - states[:, -1])
        for j in range(d):
            rate, running = point(states[:, j], inputs[:, j])
            constraints.append(slopes[:, j] - h * rate)
            cost += h * weights[j] * running
        if i == 0:
            constraints.append(starts[0] - zeta0)
    final = starts[K]
    program = {
        "x": casadi.vertcat(*unknowns, final),
        "p": zeta0,
        "f": cost + final.T @ DM(problem.P) @ final,
        "g": casadi.vertcat(*constraints),
    }
    solver = casadi.nlpsol("stages", "fatrop", program, _options(n, k, mesh))
    guess = LinearGuess(problem, mesh.times(np.array(nodes)))

    def solve(zeta0: np.ndarray) -> float:
        states, inputs = guess(zeta0)
        at_starts = np.vstack([zeta0, states[d - 1 :: d]])
        first = np.hstack([at_starts[:-1], states.reshape(K, -1), inputs.reshape(K, -1)])
        answer = solver(x0=np.append(first, at_starts[-1]), p=zeta0, lbg=0.0, ubg=0.0)
        if not solver.stats()["success"]:
            raise RuntimeError(f"fatrop returned {solver.stats()['return_status']}")
        return float(answer["f"])

    return solve


def _options(n: int, k: int, mesh: Mesh) -> dict[str, Any]:
    """Sizes of the stages, quiet, all constraints equalities."""
    d, K = mesh.degree, mesh.n_intervals
    n_constraints = [n * (d + 1)] + [n * d] * (K - 1) + [0]
    return {
        "expand": True,
        "print_time": False,
        "structure_detection": "manual",
        "N": K,
        "nx": [n] * (K + 1),
        "nu": [(n + k) * d] * K + [0],
        "ng": n_constraints,
        "equality": [True] * (n * K + sum(n_constraints)),
        "fatrop": {"print_level": 0},
    }
