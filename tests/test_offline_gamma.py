"""The value against gamma: the envelope theorem, the limits, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from stationkeep.offline import (
    DirectSolver,
    GammaCurve,
    GammaCurveSolver,
    GammaPoint,
    SaddleSolver,
    gamma_curve,
)
from stationkeep.offline.saddle.gamma import default_gammas
from stationkeep.symbolic import Game, InputError, Problem, RunError, game_riccati

from .games import FAR_STATE, FAR_VALUE, HALF_WIDTHS, Array, two_state

NODES, WEIGHTS = np.polynomial.legendre.leggauss(7)
LEFT, RIGHT = 1.4, 3.0
# Gauss points in γ^-2, in which the curve is smoothest
SPAN = 0.5 * (LEFT**-2 - RIGHT**-2)
BETWEEN = (0.5 * (LEFT**-2 + RIGHT**-2) + SPAN * NODES) ** -0.5


@pytest.fixture(scope="module")
def curve(reference_problem: Problem) -> GammaCurve:
    """From the far state: ends and Gauss points of (1.4, 3), the game's own γ, and both extremes."""
    return gamma_curve(reference_problem, FAR_STATE, [50.0, 1.05, 2.0, LEFT, RIGHT, *BETWEEN])


def at(curve: GammaCurve, gamma: float) -> GammaPoint:
    return next(point for point in curve.points if point.gamma == gamma)


def test_value_falls_to_that_without_disturbance(curve: GammaCurve) -> None:
    """V - V(∞) falls as γ^-2, so that it is -γ/2 dV/dγ for large γ; the linear value likewise."""
    gammas = [point.gamma for point in curve.points]
    assert gammas == sorted(gammas)
    assert np.all(np.diff([point.value for point in curve.points]) < 0.0)
    assert np.all(np.diff([point.linear_value for point in curve.points]) < 0.0)
    assert all(point.slope < 0.0 for point in curve.points)
    assert curve.faults == []
    last, limit = curve.points[-1], curve.undisturbed
    assert limit.gamma == np.inf
    assert limit.slope == 0.0
    assert last.value > limit.value
    assert last.value - limit.value == pytest.approx(-25.0 * last.slope, rel=1e-3)


def test_value_is_the_integral_of_its_slope(curve: GammaCurve) -> None:
    """The envelope theorem along the curve, dV/d(γ^-2) = -γ^3/2 dV/dγ, by a quadrature of order 14."""
    slopes = [-0.5 * gamma**3 * at(curve, gamma).slope for gamma in BETWEEN]
    fall = at(curve, LEFT).value - at(curve, RIGHT).value
    assert SPAN * (WEIGHTS @ slopes) == pytest.approx(fall, rel=1e-9)


def test_own_gamma_and_no_disturbance_have_the_direct_value(
    curve: GammaCurve, reference_problem: Problem
) -> None:
    assert at(curve, 2.0).value == pytest.approx(FAR_VALUE, rel=1e-10)
    alone, _ = DirectSolver(
        reference_problem.with_gamma(np.inf), horizon=120.0, n_intervals=24
    ).solve_aligned(FAR_STATE)
    assert curve.undisturbed.value == pytest.approx(alone.value, rel=1e-7)


def test_linear_game(reference_problem: Problem) -> None:
    """Value and slope are those of the Riccati solution, the slope by differences of P."""
    linear = reference_problem.linearized()
    (A, B), game = linear.linearization, linear.game

    def riccati(gamma: float) -> Array:
        return game_riccati(A, B, Game(game.Q, game.R, game.W_d, gamma))

    found = gamma_curve(linear, FAR_STATE, [1.1, 2.0, 5.0])
    for point in found.points:
        assert point.value == pytest.approx(FAR_STATE @ riccati(point.gamma) @ FAR_STATE, rel=1e-9)
        assert point.linear_value == pytest.approx(point.value, rel=1e-9)
        h = 1e-4 * (point.gamma - 1.0)
        change = (riccati(point.gamma + h) - riccati(point.gamma - h)) / (2.0 * h)
        assert point.slope == pytest.approx(FAR_STATE @ change @ FAR_STATE, rel=1e-6)


def test_small_states_have_the_linear_curve(reference_problem: Problem) -> None:
    found = gamma_curve(reference_problem, 1e-4 * HALF_WIDTHS, [1.2, 3.0])
    for point in found.points:
        assert point.value == pytest.approx(point.linear_value, rel=1e-3)


def test_horizon_follows_the_closed_loop(
    reference_problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Close to γ* twice the horizon changes nothing, though 120 s are 2e-6 short of it."""
    start = np.array([0.7, -0.35, 0.35, 0.1, -0.07, 0.35, 0, 0, 0, 0, 0, 0])
    near = gamma_curve(reference_problem, start, [1.02]).points[0]
    monkeypatch.setattr("stationkeep.offline.saddle.gamma.HORIZON", 20.0)
    twice = gamma_curve(reference_problem, start, [1.02]).points[0]
    assert near.value == pytest.approx(twice.value, rel=1e-11)
    assert near.slope == pytest.approx(twice.slope, rel=1e-9)
    short = SaddleSolver(reference_problem.with_gamma(1.02)).solve(start).value
    assert abs(short - near.value) > 1e-7 * near.value


def test_default_levels_are_denser_towards_the_threshold(reference_problem: Problem) -> None:
    levels = np.array(default_gammas(reference_problem))
    assert levels[0] == pytest.approx(1.05)
    assert levels[-1] == pytest.approx(10.0)
    steps = np.diff(np.log(levels - 1.0))
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    problem, _, _ = two_state()
    found = gamma_curve(problem, np.array([1.0, -0.5]))
    assert len(found.points) == len(default_gammas(problem))
    assert found.faults == []


@pytest.mark.parametrize(
    ("gammas", "words"),
    [
        ([2.0, 1.0], "gamma* of the linearised game is 1)"),
        ([0.5], "gamma = 0.5 is too small"),
        ([-1.0], "positive"),
        ([], "at least one"),
        ([2.0, np.inf], "finite"),
        ([np.nan], "finite"),
    ],
)
def test_levels_without_a_game_are_refused(
    reference_problem: Problem,
    one_sentence: Callable[[BaseException], str],
    gammas: list[float],
    words: str,
) -> None:
    with pytest.raises(InputError) as caught:
        GammaCurveSolver(reference_problem, gammas, compiled=False)
    assert words in one_sentence(caught.value)


def test_a_lost_level_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _, _ = two_state()
    solve = SaddleSolver.solve_aligned

    def lost(solver: SaddleSolver, *arguments: object, **options: object) -> object:
        if solver.problem.game.gamma == 2.0:
            raise RunError("lost on the way")
        return solve(solver, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(SaddleSolver, "solve_aligned", lost)
    found = gamma_curve(problem, np.array([1.0, 0.5]), [1.5, 2.0, 3.0])
    assert found.faults == ["gamma = 2: lost on the way"]
    assert np.isnan(found.points[1].value)
    assert found.points[1].linear_value > 0.0
    assert found.points[0].value > found.points[2].value > found.undisturbed.value


def test_a_rising_value_is_a_fault() -> None:
    point = GammaPoint(2.0, 10.0, 9.0, -1.0)
    limit = replace(point, gamma=np.inf, value=8.0, slope=0.0)
    rising = GammaCurve(np.zeros(2), 1.0, [point, replace(point, gamma=3.0, value=11.0)], limit)
    assert rising.faults == ["the value rises from gamma = 2 to 3"]
