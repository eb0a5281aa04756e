"""Several extremals from one state: the mirror pair beside a symmetric one, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest
from casadi import SX, substitute
from stationkeep.offline import DirectSolver, OfflineSettings, OfflineSolver, solve
from stationkeep.symbolic import Game, Problem

from .games import FAR_STATE, HALF_WIDTHS, two_state

AXES = pytest.mark.parametrize(
    ("axis", "distance"), [(2, 2.0), (0, 3.0)], ids=["heave 2 m", "surge 3 m"]
)


def on_axis(problem: Problem, axis: int) -> Problem:
    """The same game with all motion but that along one axis forbidden: two states, one input."""
    zeta = SX.sym("zeta", 2)
    only = [SX(0)] * 12
    only[axis], only[axis + 6] = zeta[0], zeta[1]
    keep, game, whole = [axis, axis + 6], problem.game, SX.zeros(12)
    for i in range(12):
        whole[i] = only[i]
    drift, g = substitute([problem.drift, problem.input_matrix], [problem.zeta], [whole])
    reduced = Game(game.Q[np.ix_(keep, keep)], game.R[axis, axis : axis + 1], np.eye(1), game.gamma)
    scale = problem.scale[keep]
    return Problem("on an axis", zeta, drift[keep], g[keep, axis], reduced, scale, switching=zeta[1])


@pytest.mark.slow
@AXES
def test_mirror_pair_lies_below_the_symmetric_extremal(
    reference_problem: Problem, axis: int, distance: float
) -> None:
    """Independent of any start: the symmetric extremal is the optimum of the game on the axis alone."""
    zeta0 = distance * np.eye(12)[axis]
    answer = OfflineSolver(reference_problem).solve(zeta0)
    straight = solve(on_axis(reference_problem, axis), zeta0[[axis, axis + 6]]).value
    assert answer.faults == []
    assert not answer.certificate.gradient_unique
    gain = (straight - answer.value) / straight
    print(f"the pair is {gain:.3e} below the symmetric extremal")
    assert gain > 1e-7
    mirror = answer.others[0]
    assert mirror.second_order
    assert mirror.value == pytest.approx(answer.value, rel=1e-9)
    # mirror images: the same in the plane of symmetry, opposite across it
    ratio = answer.costate * HALF_WIDTHS / np.linalg.norm(answer.costate * HALF_WIDTHS)
    image = mirror.costate * HALF_WIDTHS / np.linalg.norm(answer.costate * HALF_WIDTHS)
    np.testing.assert_allclose(np.abs(ratio), np.abs(image), atol=1e-6)
    assert np.abs(ratio - image).max() > 1e-5


def test_saddle_point_agrees_with_the_pair(reference_problem: Problem) -> None:
    """The boundary value problem, never started from the direct solution, finds the pair's value."""
    answer = OfflineSolver(reference_problem).solve(2.0 * np.eye(12)[2])
    assert answer.saddle is not None
    assert answer.certificate.disagreement < 1e-9


def test_an_ordinary_state_has_one_extremal(reference_problem: Problem) -> None:
    answer = OfflineSolver(reference_problem, OfflineSettings(starts=6)).solve(FAR_STATE)
    assert answer.others == []
    assert answer.certificate.gradient_unique
    assert answer.certificate.second_order


def test_second_order_verdict_of_ipopt_agrees(reference_problem: Problem) -> None:
    """IPOPT need not correct its inertia where the minimum is strict."""
    direct = DirectSolver(reference_problem, horizon=60.0, n_intervals=20, method="ipopt")
    assert direct.solve(FAR_STATE, verify=False).second_order
    assert solve(two_state()[0], np.array([1.0, -0.7])).certificate.second_order
