"""yapss, pseudospectral collocation on Legendre-Gauss-Radau points (the first at the interval's start).

Exact derivatives are given as functions, differentiated once by CasADi: yapss's own automatic
derivatives are made anew in every solve, which takes a fifth longer. Without scaled cost and integral
(by 1e3) IPOPT often ends in its restoration phase.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import yapss
from casadi import SX
from stationkeep.symbolic import Problem
from stationkeep.symbolic.arrays import Array

from .game import LinearGuess, Mesh, Solve, point_function

COST_SCALE = 1e3


def build(problem: Problem, mesh: Mesh) -> Solve:
    """Return a solve of one yapss problem whose initial state and guess change."""
    n, k, horizon = problem.n_states, problem.n_inputs, mesh.horizon
    ocp = yapss.Problem(name="station keeping", nx=[n], nu=[k], nq=[1])
    _set_functions(ocp, _Derivatives.build(problem), problem.P)
    ocp.derivatives.method, ocp.derivatives.order = "user", "second"
    ocp.spectral_method = "lgr"
    ocp.mesh.phase[0].collocation_points = (mesh.degree,) * mesh.n_intervals
    ocp.mesh.phase[0].fraction = tuple(np.diff(mesh.points) / horizon)
    ocp.scale.objective = COST_SCALE
    ocp.scale.phase[0].integral[:] = COST_SCALE
    ocp.ipopt_options.print_level, ocp.ipopt_options.sb = 0, "yes"
    bounds, first = ocp.bounds.phase[0], ocp.guess.phase[0]
    bounds.initial_time.lower = bounds.initial_time.upper = 0.0
    bounds.final_time.lower = bounds.final_time.upper = horizon
    nodes = 1.0 - np.array(casadi.collocation_points(mesh.degree, "radau"))[::-1]
    times = np.append(mesh.times(nodes), horizon)
    guess = LinearGuess(problem, times)

    def solve(zeta0: Array) -> float:
        bounds.initial_state.lower[:] = bounds.initial_state.upper[:] = zeta0
        states, inputs = guess(zeta0)
        first.time, first.state, first.control = times, states.T, inputs.T
        first.integral = [zeta0 @ problem.P @ zeta0]
        solution = ocp.solve()
        if solution.nlp_info.ipopt_status not in (0, 1):
            raise RuntimeError(f"IPOPT returned {solution.nlp_info.ipopt_status}")
        return float(solution.objective)

    return solve


@dataclass(frozen=True)
class _Derivatives:
    """ζ_dot and running cost, their Jacobian and Hessians: functions of the columns (ζ, v).

    The entries of `jacobian` and `hessian` are the rows of the functions' results, by yapss's keys.
    """

    values: casadi.Function
    jacobian: casadi.Function
    jacobian_keys: list[tuple[Any, ...]]
    hessian: casadi.Function
    hessian_keys: list[tuple[Any, ...]]

    @classmethod
    def build(cls, problem: Problem) -> _Derivatives:
        n, k = problem.n_states, problem.n_inputs
        w = SX.sym("w", n + k)
        results = casadi.vertcat(*point_function(problem)(w[:n], w[n:]))
        variables = [("x", i) for i in range(n)] + [("u", i) for i in range(k)]
        names = [("f", i) for i in range(n)] + [("g", 0)]
        jacobian = casadi.jacobian(results, w)
        jacobian_keys = [
            (names[i], variables[j]) for i, j in zip(*jacobian.sparsity().get_triplet(), strict=True)
        ]
        entries, hessian_keys = [jacobian.nz[:]], []
        hessian_entries = []
        for name, result in zip(names, casadi.vertsplit(results), strict=True):
            hessian = casadi.tril(casadi.hessian(result, w)[0])
            hessian_entries.append(hessian.nz[:])
            for i, j in zip(*hessian.sparsity().get_triplet(), strict=True):
                hessian_keys.append((name, variables[i], variables[j]))
        return cls(
            values=casadi.Function("values", [w], [results]),
            jacobian=casadi.Function("jacobian_entries", [w], entries),
            jacobian_keys=jacobian_keys,
            hessian=casadi.Function(
                "hessian_entries", [w], [casadi.vertcat(*hessian_entries)], {"cse": True}
            ),
            hessian_keys=hessian_keys,
        )


def _set_functions(ocp: yapss.Problem, derivatives: _Derivatives, P: Array) -> None:
    n = len(P)

    def columns(phase: Any) -> Array:
        return np.vstack([*phase.state, *phase.control])

    def objective(arg: Any) -> None:
        phase = arg.phase[0]
        arg.objective = phase.integral[0] + phase.final_state @ P @ phase.final_state

    def objective_gradient(arg: Any) -> None:
        arg.gradient[(0, "q", 0)] = 1.0
        for i, slope in enumerate(2.0 * P @ arg.phase[0].final_state):
            arg.gradient[(0, "xf", i)] = slope

    def objective_hessian(arg: Any) -> None:
        for i in range(n):
            for j in range(i + 1):
                arg.hessian[((0, "xf", i), (0, "xf", j))] = 2.0 * P[i, j]

    def continuous(arg: Any) -> None:
        phase = arg.phase[0]
        values = derivatives.values(columns(phase)).full()
        phase.dynamics[:], phase.integrand[:] = values[:n], values[n:]

    def continuous_jacobian(arg: Any) -> None:
        phase = arg.phase[0]
        rows = derivatives.jacobian(columns(phase)).full()
        phase.jacobian.update(zip(derivatives.jacobian_keys, rows, strict=True))

    def continuous_hessian(arg: Any) -> None:
        phase = arg.phase[0]
        rows = derivatives.hessian(columns(phase)).full()
        phase.hessian.update(zip(derivatives.hessian_keys, rows, strict=True))

    functions = ocp.functions
    functions.objective = objective
    functions.objective_gradient = objective_gradient
    functions.objective_hessian = objective_hessian
    functions.continuous = continuous
    functions.continuous_jacobian = continuous_jacobian
    functions.continuous_hessian = continuous_hessian
