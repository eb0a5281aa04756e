"""The structured Newton method: IPOPT's discrete optimum, Riccati's Hessian, conjugate points."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.offline import DirectSolver
from stationkeep.offline.direct import StructuredNewton
from stationkeep.offline.path import Grid, graded_mesh
from stationkeep.symbolic import InputError, Problem

from .games import FAR_STATE, FAST_STATE, HALF_WIDTHS, linear_quadratic, two_state


@pytest.fixture(scope="module")
def newton(reference_problem: Problem) -> StructuredNewton:
    """The method on the shipped game, in CasADi's virtual machine."""
    return StructuredNewton(reference_problem, compiled=False)


def grid_of(horizon: float, n_intervals: int, degree: int) -> Grid:
    return Grid(graded_mesh(horizon, n_intervals, 4.0), degree, 6)


@pytest.mark.parametrize("degree", [2, 3, 6])
@pytest.mark.parametrize("state", [FAR_STATE, FAST_STATE], ids=["far", "fast"])
def test_same_discrete_optimum_as_ipopt(
    reference_problem: Problem, newton: StructuredNewton, degree: int, state: np.ndarray
) -> None:
    """Eliminating v changes the unknowns, not the problem: value, costate, states and input agree."""
    grid = grid_of(40.0, 12, degree)
    ours = newton.solve(state, grid, newton.linear_guess(state, grid))
    direct = DirectSolver(
        reference_problem, horizon=40.0, n_intervals=12, degree=degree, grading=4.0, method="ipopt"
    )
    theirs = direct.solve(state, verify=False)
    assert ours.value == pytest.approx(theirs.value, rel=1e-10)
    np.testing.assert_allclose(ours.costate, theirs.costate, atol=1e-7 * np.abs(theirs.costate).max())
    np.testing.assert_allclose(
        ours.states / HALF_WIDTHS, theirs.trajectory.states / HALF_WIDTHS, atol=1e-7
    )
    np.testing.assert_allclose(ours.v, theirs.trajectory.v, atol=1e-6)
    assert ours.curvature is None


def test_linear_game_needs_one_step_and_its_hessian_is_riccati() -> None:
    """V = ζ'P ζ: the Hessian of the value is 2 P, and Newton's method is exact at once."""
    problem = linear_quadratic()[0]
    newton, grid = StructuredNewton(problem, compiled=False), grid_of(60.0, 40, 6)
    found = newton.solve(FAR_STATE, grid, np.zeros((40, 6, 6)))
    assert found.iterations <= 3
    assert found.value == pytest.approx(float(FAR_STATE @ problem.P @ FAR_STATE), rel=1e-9)
    assert found.hessian is not None
    np.testing.assert_allclose(found.hessian, 2.0 * problem.P, atol=1e-7 * np.abs(problem.P).max())


def test_hessian_is_the_derivative_of_the_costate(newton: StructuredNewton) -> None:
    grid, step = grid_of(40.0, 12, 5), 1e-5
    here = newton.solve(FAR_STATE, grid, newton.linear_guess(FAR_STATE, grid))
    assert here.hessian is not None
    for i in (0, 4, 5, 8):
        shift = step * HALF_WIDTHS[i] * np.eye(12)[i]
        ahead, behind = (newton.solve(FAR_STATE + s, grid, here.accelerations) for s in (shift, -shift))
        slope = (ahead.costate - behind.costate) / (2.0 * step * HALF_WIDTHS[i])
        np.testing.assert_allclose(here.hessian[i], slope, atol=1e-5 * np.abs(here.hessian).max())


def test_conjugate_point_on_the_symmetric_extremal(newton: StructuredNewton) -> None:
    """From 2 m in heave the straight way home is stationary, and its curvature points downhill."""
    grid, zeta0 = grid_of(40.0, 20, 5), 2.0 * np.eye(12)[2]
    straight = newton.solve(zeta0, grid, newton.linear_guess(zeta0, grid))
    assert np.abs(np.delete(straight.states, [2, 8], axis=1)).max() < 1e-9
    assert straight.curvature is not None
    assert straight.hessian is None
    for side in (0.01, -0.01):
        bent = newton.solve(zeta0, grid, straight.accelerations + side * straight.curvature)
        assert bent.curvature is None
        gain = (straight.value - bent.value) / straight.value
        assert 1e-7 < gain < 1e-3


def test_needs_inverse_dynamics() -> None:
    with pytest.raises(InputError, match="inverse dynamics; use IPOPT"):
        StructuredNewton(two_state()[0])
