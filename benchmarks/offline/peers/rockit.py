"""rockit (`rockit-meco`), direct Radau collocation on its geometric grid.

A rockit control is constant on an interval, which would limit the value to 1e-5 at any affordable
mesh, as its order-1 control does; its order-2 control reaches 1e-6 in a second. Its coefficients can
be controls though: v = Σ_j c_j l_j(s) with Lagrange polynomials l_j on the collocation points of the
local time s, which makes rockit's program the one of pseudospectral collocation.
"""

from __future__ import annotations

from math import prod

import casadi
import numpy as np
import rockit
from casadi import DM, MX
from stationkeep.symbolic import Problem

from .game import LinearGuess, Mesh, Solve, point_function


def build(problem: Problem, mesh: Mesh) -> Solve:
    """Return a solve by the function that rockit makes of the transcribed problem."""
    n, k, d, K = problem.n_states, problem.n_inputs, mesh.degree, mesh.n_intervals
    starts, lengths = mesh.points[:-1], np.diff(mesh.points)
    ocp = rockit.Ocp(T=mesh.horizon)
    zeta, zeta0 = ocp.state(n), ocp.parameter(n)
    coefficients = ocp.control(k * d)
    begin, h = ocp.parameter(grid="control"), ocp.parameter(grid="control")
    v = casadi.reshape(coefficients, k, d) @ _lagrange((ocp.t - begin) / h, d)
    rate, running = point_function(problem)(zeta, v)
    ocp.set_der(zeta, rate)
    ocp.subject_to(ocp.at_t0(zeta) == zeta0)
    final = ocp.at_tf(zeta)
    ocp.add_objective(ocp.integral(running) + final.T @ DM(problem.P) @ final)
    quiet = {"print_level": 0, "sb": "yes"}
    ocp.solver("ipopt", {"expand": True, "print_time": False, "ipopt": quiet})
    grid = rockit.GeometricGrid(np.exp(mesh.grading * (K - 1) / K))
    ocp.method(rockit.DirectCollocation(N=K, degree=d, scheme="radau", grid=grid))
    for parameter, value in ((zeta0, np.zeros(n)), (begin, starts), (h, lengths)):
        ocp.set_value(parameter, value)
    sampled = [
        ocp.sample(signal, grid=where)[1]
        for signal, where in (
            (zeta, "control"),
            (coefficients, "control-"),
            (begin, "control-"),
            (h, "control-"),
        )
    ]
    program = ocp.to_function("solve", [zeta0, *sampled], [ocp.value(ocp.objective)])
    at_grid = LinearGuess(problem, mesh.points)
    at_nodes = LinearGuess(problem, mesh.times(np.array(casadi.collocation_points(d, "radau"))))

    def solve(zeta0: np.ndarray) -> float:
        inputs = at_nodes(zeta0)[1].reshape(K, k * d)
        return float(program(zeta0, at_grid(zeta0)[0].T, inputs.T, starts, lengths))

    return solve


def _lagrange(s: MX, degree: int) -> MX:
    """Return the Lagrange polynomials of the Radau points at `s`, shape (degree,)."""
    nodes = casadi.collocation_points(degree, "radau")
    polynomials = []
    for j, node in enumerate(nodes):
        others = [(s - other) / (node - other) for i, other in enumerate(nodes) if i != j]
        polynomials.append(prod(others, start=MX(1)))
    return casadi.vertcat(*polynomials)
