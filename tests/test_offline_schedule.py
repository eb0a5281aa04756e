"""Worst cases against weights that change in time, on games whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are
from stationkeep.offline import ScheduledWorstCase, WeightSchedule
from stationkeep.symbolic import InputError

from .games import FAR_STATE, TWO_STATE_WEIGHTS, linear_quadratic, two_state

ZETA = np.array([1.0, -1.2])


@pytest.fixture(scope="module")
def solver() -> ScheduledWorstCase:
    problem, basis, _ = two_state()
    return ScheduledWorstCase(problem, basis, horizon=25.0)


def test_exact_weights_cost_the_value_however_they_are_cut(solver: ScheduledWorstCase) -> None:
    """V* = ζ_1^2 / 2 + ζ_2^2 is the worst case of W* = (1/2, 0, 1), also with a jump to W* itself."""
    pieces = np.array([TWO_STATE_WEIGHTS, TWO_STATE_WEIGHTS])
    for schedule in (
        WeightSchedule.constant(TWO_STATE_WEIGHTS),
        WeightSchedule(np.array([0.0, 0.7]), pieces),
    ):
        assert not schedule.jumps.size
        worst = solver.solve(ZETA, schedule)
        assert worst.cost == pytest.approx(0.5 + 1.2**2, rel=1e-8)
        assert worst.second_order is not None
        assert worst.second_order.holds


def test_frozen_weights_of_the_linear_game_cost_their_riccati_solution() -> None:
    """With u_1 = -1.2 K* ζ the worst case is ζ'X ζ, X of the bounded-real equation by scipy."""
    problem, basis, _ = linear_quadratic()
    game, (A, B) = problem.game, problem.linearization
    K = 1.2 * np.linalg.inv(game.R) @ B.T @ problem.P
    level = -(game.gamma**2) * game.W_d
    X = solve_continuous_are(A - B @ K, B, game.Q + K.T @ game.R @ K, level)
    weights = WeightSchedule.constant(1.2 * basis.quadratic_weights(problem.P))
    worst = ScheduledWorstCase(problem, basis).solve(FAR_STATE, weights)
    assert worst.cost == pytest.approx(float(FAR_STATE @ X @ FAR_STATE), rel=1e-7)
    assert worst.cost > 1.005 * float(FAR_STATE @ problem.P @ FAR_STATE)


def test_a_linear_schedule_costs_the_riccati_differential_equation() -> None:
    """Gains that jump at 0.6 s: ζ'X(0) ζ with -X_dot = A_K'X + X A_K + Q + K'RK + X B W B'X / γ^2."""
    base, basis, _ = two_state()
    problem = base.linearized()
    game, (A, B) = problem.game, problem.linearization
    T, jump, factors = 3.0, 0.6, (1.4, 0.8)
    weights = basis.quadratic_weights(problem.P)
    schedule = WeightSchedule(np.array([0.0, jump]), np.array([f * weights for f in factors]))
    K = np.linalg.inv(game.R) @ B.T @ problem.P

    def rate(gain: np.ndarray) -> object:
        def slope(t: float, y: np.ndarray) -> np.ndarray:
            X, closed = y.reshape(2, 2), A - B @ gain
            quadratic = X @ B @ np.linalg.inv(game.W_d) @ B.T @ X / game.gamma**2
            return (closed.T @ X + X @ closed + game.Q + gain.T @ game.R @ gain + quadratic).ravel()

        return slope

    X = problem.P.ravel()
    for factor, span in ((factors[1], T - jump), (factors[0], jump)):
        X = solve_ivp(rate(factor * K), (0.0, span), X, rtol=1e-11, atol=1e-12).y[:, -1]  # type: ignore[arg-type]
    worst = ScheduledWorstCase(problem, basis, horizon=T).solve(ZETA, schedule)
    assert worst.path is not None
    assert jump in worst.path.mesh
    assert worst.cost == pytest.approx(float(ZETA @ X.reshape(2, 2) @ ZETA), rel=1e-9)
    assert worst.reintegrated == pytest.approx(worst.cost, rel=1e-8)


def test_excursions_beyond_the_reach_count_as_run_off() -> None:
    problem, basis, _ = two_state()
    near = ScheduledWorstCase(problem, basis, horizon=25.0, reach=0.1)
    worst = near.solve(np.array([0.0, 0.3]), WeightSchedule.constant(TWO_STATE_WEIGHTS))
    assert worst.unbounded is not None
    assert "reaches 0.15 half-widths" in worst.unbounded
    assert np.isinf(worst.cost)


def test_schedule_holds_its_weights_from_each_time_on() -> None:
    schedule = WeightSchedule(np.array([0.0, 1.0, 2.0]), np.array([[1.0], [1.0], [3.0]]))
    np.testing.assert_array_equal(schedule.at(np.array([0.0, 1.9, 2.0, 9.0])).ravel(), [1, 1, 3, 3])
    np.testing.assert_array_equal(schedule.jumps, [2.0])
    np.testing.assert_array_equal(schedule.by_interval(np.array([0.0, 2.0, 4.0])).ravel(), [1, 3])


def test_bad_schedules(solver: ScheduledWorstCase) -> None:
    with pytest.raises(InputError, match="start at 0 and ascend"):
        WeightSchedule(np.array([0.0, 0.0]), np.ones((2, 3)))
    with pytest.raises(InputError, match="a row of weights for each time"):
        WeightSchedule(np.array([0.0]), np.ones((2, 3)))
    with pytest.raises(InputError, match="the basis has 3"):
        solver.solve(ZETA, WeightSchedule.constant(np.ones(4)))
