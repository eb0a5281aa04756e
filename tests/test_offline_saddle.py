"""The saddle point by Pontryagin's boundary value problem: closed forms, and the direct solution."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.offline import DirectSolver, SaddleSolver
from stationkeep.symbolic import InputError, Problem, RunError, closed_form_problem

from .games import FAR_STATE, FAR_VALUE, FAST_STATE, FAST_VALUE


def test_two_state_game_has_its_closed_form() -> None:
    """V* = z1^2/2 + z2^2, so λ(0) = (z1, 2 z2); both players are the policies (8) and (9)."""
    problem = closed_form_problem()
    solver = SaddleSolver(problem, horizon=20.0, n_intervals=40)
    for zeta in np.random.default_rng(3).uniform(-2.0, 2.0, (20, 2)):
        solution = solver.solve(zeta)
        assert solution.value == pytest.approx(0.5 * zeta[0] ** 2 + zeta[1] ** 2, rel=1e-8)
        np.testing.assert_allclose(solution.costate, [zeta[0], 2.0 * zeta[1]], rtol=1e-8, atol=1e-8)
        g = np.array([[0.0], [np.cos(2.0 * solution.states[-1][0]) + 2.0]])
        control, disturbance = problem.game.policies(g, solution.costates[-1])
        np.testing.assert_allclose(solution.u_control[-1], control, atol=1e-12)
        np.testing.assert_allclose(solution.u_disturbance[-1], disturbance, atol=1e-12)


def test_linear_quadratic_game(reference_problem: Problem) -> None:
    """The value is ζ'P ζ and the costate 2 P ζ along the whole trajectory."""
    linear = reference_problem.linearized()
    solution = SaddleSolver(linear, n_intervals=40).solve(FAR_STATE)
    assert solution.value == pytest.approx(FAR_STATE @ linear.P @ FAR_STATE, rel=1e-9)
    expected = 2.0 * solution.states @ linear.P
    np.testing.assert_allclose(solution.costates, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("zeta", "value"), [(FAR_STATE, FAR_VALUE), (FAST_STATE, FAST_VALUE)], ids=["far", "fast"]
)
def test_agrees_with_the_direct_solution(
    reference_problem: Problem, zeta: np.ndarray, value: float
) -> None:
    """Other unknowns, other derivatives of the model, another mesh and degree; the same optimum."""
    direct, _ = DirectSolver(reference_problem, n_intervals=30).solve_aligned(zeta)
    mesh = direct.trajectory.mesh
    halved = np.unique(np.concatenate([mesh, 0.5 * (mesh[1:] + mesh[:-1])]))
    solution = SaddleSolver(reference_problem, degree=4).solve(zeta, mesh=halved)
    assert solution.value == pytest.approx(value, rel=1e-8)
    assert solution.value == pytest.approx(direct.value, rel=1e-8)
    norm = np.linalg.norm(direct.costate)
    np.testing.assert_allclose(solution.costate, direct.costate, atol=1e-7 * norm)


def test_bad_states_and_lost_continuation(monkeypatch: pytest.MonkeyPatch) -> None:
    solver = SaddleSolver(closed_form_problem(), horizon=5.0, n_intervals=4)
    with pytest.raises(InputError, match="finite"):
        solver.solve(np.array([np.nan, 0.0]))
    monkeypatch.setattr(solver, "_newton", lambda *_: (None, 1))
    with pytest.raises(RunError, match="no saddle point was found beyond"):
        solver.solve(np.array([1.0, 1.0]))
