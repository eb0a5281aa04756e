"""The optimum under a known disturbance against the Riccati equations with feedforward, and V*."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from scipy.integrate import solve_ivp
from stationkeep.offline import DirectSolver
from stationkeep.offline.direct import against_known
from stationkeep.offline.path import CLAIRVOYANT, GrowingMesh, growing_mesh
from stationkeep.offline.responses import ClairvoyantSolver
from stationkeep.symbolic import Problem, RunError

from .games import Array

A = np.array([[0.0, 1.0], [-0.2, -0.3]])
B = np.array([[0.0], [1.0]])
Q, R = np.diag([3.0, 1.0]), np.array([[0.5]])
START = np.array([1.0, -0.5])
FREQUENCY, STEP, HORIZON = 1.7, 3.0, 8.0


def push(t: float) -> float:
    """A force that is a sinusoid at first, and another one, stronger, from 3 s on."""
    return float(np.sin(FREQUENCY * t) if t < STEP else 2.0 + np.cos(FREQUENCY * t))


def expression(t: SX) -> SX:
    return casadi.if_else(t >= STEP, 2.0 + casadi.cos(FREQUENCY * t), casadi.sin(FREQUENCY * t))


def closed_form(force: Callable[[float], float]) -> tuple[float, float]:
    """Return V(0) and u(0): V = ζ'P ζ + 2 s'ζ + q with P, s and q integrated back from zero at T.

    -P_dot = A'P + P A - P B R^-1 B'P + Q, -s_dot = (A - B R^-1 B'P)'s + P B d and
    -q_dot = 2 s'B d - s'B R^-1 B's (Bryson and Ho 1975, sec. 5.2, with a known force).
    """
    S = B @ np.linalg.inv(R) @ B.T

    def rates(t: float, y: Array) -> Array:
        P, s = y[:4].reshape(2, 2), y[4:6]
        pushed = B[:, 0] * force(t)
        back = A.T @ P + P @ A - P @ S @ P + Q
        return -np.concatenate(
            [back.ravel(), (A - S @ P).T @ s + P @ pushed, [2 * s @ pushed - s @ S @ s]]
        )

    y = np.zeros(7)
    for span in ((HORIZON, STEP), (np.nextafter(STEP, 0.0), 0.0)):
        y = solve_ivp(rates, span, y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    P, s = y[:4].reshape(2, 2), y[4:6]
    value = START @ P @ START + 2.0 * s @ START + y[6]
    control = -np.linalg.inv(R) @ B.T @ (P @ START + s)
    return float(value), float(control[0])


def pushed_solver(tolerance: float, mesh: GrowingMesh = CLAIRVOYANT) -> ClairvoyantSolver:
    zeta, u, t = SX.sym("zeta", 2), SX.sym("u"), SX.sym("t")
    stage = against_known(zeta, u, t, DM(A) @ zeta + DM(B) @ (u + expression(t)), Q, R)
    return ClairvoyantSolver(stage, R, HORIZON, (STEP,), mesh=mesh, tolerance=tolerance)


def test_a_known_force_has_the_value_of_riccati_and_feedforward() -> None:
    value, control = closed_form(push)
    found = pushed_solver(tolerance=1e-9).solve(START, [lambda t, zeta: -zeta[:1]])
    assert found.value == pytest.approx(value, rel=1e-9)
    assert found.path.sample(np.array([1e-9]))[1][0, 0] == pytest.approx(control, rel=1e-6)
    assert found.mesh_error <= 1e-9
    assert STEP in found.path.mesh
    assert found.second_order.holds
    np.testing.assert_allclose(found.starts, found.starts[0], rtol=1e-9)


def test_the_error_of_the_mesh_is_what_refinement_takes_away() -> None:
    value, _ = closed_form(push)
    rough_mesh = replace(CLAIRVOYANT, degree=2)
    rough = pushed_solver(tolerance=1.0, mesh=rough_mesh).solve(START, [])
    better = pushed_solver(tolerance=1e-7, mesh=rough_mesh).solve(START, [])
    assert rough.rounds == 1
    assert better.rounds > 1
    assert abs(rough.value - value) <= rough.mesh_error * value
    assert abs(better.value - value) <= 1e-7 * value < abs(rough.value - value)


@pytest.mark.slow
def test_without_disturbance_and_in_time_it_is_the_optimum_of_one_player(
    reference_problem: Problem,
) -> None:
    """γ = infinity, from an envelope state: V* by the offline solver, which shares no program."""
    problem = reference_problem.with_gamma(np.inf)
    zeta0 = np.array([0.7, -0.35, 0.35, 0.1, -0.07, 0.35, 0, 0, 0, 0, 0, 0])
    optimum = DirectSolver(problem, horizon=60.0, n_intervals=24)
    u, t = SX.sym("u", 6), SX.sym("t")
    rate = problem.drift + problem.input_matrix @ u
    game = problem.game
    solver = ClairvoyantSolver(against_known(problem.zeta, u, t, rate, game.Q, game.R), game.R, 60.0)
    found = solver.solve(zeta0, [])
    assert found.value == pytest.approx(optimum.solve(zeta0, verify=False).value, rel=1e-7)
    assert found.second_order.holds


def test_a_plant_that_has_no_solution_says_so() -> None:
    zeta, u, t = SX.sym("zeta"), SX.sym("u"), SX.sym("t")
    one = np.eye(1)
    runaway = against_known(zeta, u, t, casadi.exp(10.0 * zeta * zeta) + 0.0 * u, one, one)
    with pytest.raises(RunError, match="IPOPT"):
        ClairvoyantSolver(runaway, one, 5.0).solve(np.ones(1), [])


def test_growing_mesh_grows_from_every_break() -> None:
    mesh = growing_mesh(10.0, np.array([4.0, 12.0, 0.0]), shortest=0.1, longest=1.0)
    lengths = np.diff(mesh)
    assert mesh[0] == 0.0
    assert mesh[-1] == 10.0
    assert lengths.min() > 0.0
    assert lengths.max() <= 1.5
    at = int(np.flatnonzero(mesh == 4.0)[0])
    assert [lengths[0], lengths[at]] == pytest.approx([0.1, 0.1])
    np.testing.assert_allclose(lengths[1:3] / lengths[:2], 1.5)
    np.testing.assert_array_equal(
        growing_mesh(0.02, np.empty(0), shortest=0.1, longest=1.0), [0.0, 0.02]
    )
