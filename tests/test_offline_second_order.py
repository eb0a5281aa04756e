"""The second-order condition: a textbook focal point, and the reduced Hessian formed whole."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
import scipy.linalg
from casadi import SX
from stationkeep.offline import Trajectory
from stationkeep.offline.direct import Optimum, Stage, Transcription, against_control, second_order

from .games import two_state


def at_rest(stage: Stage, horizon: float, n_intervals: int) -> tuple[Transcription, Optimum]:
    """Return the stationary point at the origin, where everything is zero."""
    program = Transcription(stage, n_intervals, 4)
    mesh = np.linspace(0.0, horizon, n_intervals + 1)
    n, k = stage.zeta.shape[0], stage.w.shape[0]
    points = program.n_points
    times = np.append(0.0, program.times(mesh))
    path = Trajectory(mesh, times, np.zeros((points + 1, n)), np.zeros((points, k)), 4)
    arguments = np.concatenate([np.zeros(n), np.diff(mesh)])
    return program, Optimum(0.0, path, np.zeros(n * (points + 1)), arguments, 0)


def oscillator() -> Stage:
    """∫ w^2 - x^2 with x_dot = w from a fixed x: a minimum up to T = π/2, and not beyond."""
    x, w = SX.sym("x"), SX.sym("w")
    return Stage(x, w, SX(0, 1), w, w**2 - x**2, np.zeros((1, 1)))


@pytest.mark.parametrize("horizon", [0.5, 1.5, 1.57])
def test_oscillator_before_its_focal_point(horizon: float) -> None:
    verdict = second_order(*at_rest(oscillator(), horizon, 20))
    assert verdict.holds
    assert 0.0 < verdict.margin < 1.0


@pytest.mark.parametrize("horizon", [1.58, 2.0, 3.0])
def test_oscillator_beyond_its_focal_point(horizon: float) -> None:
    """Going back from T the condition is lost π/2 earlier, on the interval that holds that time."""
    verdict = second_order(*at_rest(oscillator(), horizon, 40))
    assert not verdict.holds
    assert verdict.margin <= 0.0
    assert verdict.conjugate is not None
    lost = horizon - np.pi / 2.0
    assert verdict.conjugate <= lost <= verdict.conjugate + 2.0 * horizon / 40


@pytest.mark.parametrize("stiffness", [0.2, 0.8, 1.1, 1.5, 3.0])
def test_agrees_with_the_whole_reduced_hessian(stiffness: float) -> None:
    """The projection on the null space of the constraints has a negative eigenvalue, or not."""
    x, v, w = SX.sym("x"), SX.sym("v"), SX.sym("w", 2)
    rate = casadi.vertcat(v + 0.3 * w[1], -x - 0.2 * v + w[0])
    running = w.T @ w + 0.3 * w[0] * w[1] - stiffness * (x**2 + 0.5 * x * v)
    stage = Stage(casadi.vertcat(x, v), w, SX(0, 1), rate, running, np.diag([0.3, -0.1]))
    program, optimum = at_rest(stage, 2.0, 5)
    hessian, jacobian = (part.toarray() for part in program.curvature(optimum))
    free = scipy.linalg.null_space(jacobian)
    smallest = float(np.linalg.eigvalsh(free.T @ hessian @ free)[0])
    verdict = second_order(program, optimum)
    assert verdict.holds == (smallest > 0.0)
    assert np.sign(verdict.margin) == np.sign(smallest)


def test_both_verdicts_occur_in_a_game() -> None:
    """Without control the two-state plant is unstable: the disturbance has no strict maximum."""
    problem, _, _ = two_state()
    weak, strong = (
        against_control(problem, -gain * problem.zeta[1:], SX(0, 1), problem.P) for gain in (0.0, 3.0)
    )
    assert not second_order(*at_rest(weak, 5.0, 20)).holds
    assert second_order(*at_rest(strong, 5.0, 20)).holds


def test_margin_of_a_convex_problem_is_at_least_one() -> None:
    x, w = SX.sym("x"), SX.sym("w")
    stage = Stage(x, w, SX(0, 1), w - x, w**2 + x**2, np.ones((1, 1)))
    assert second_order(*at_rest(stage, 4.0, 8)).margin >= 1.0 - 1e-12
