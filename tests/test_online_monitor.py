"""The monitor: every number of a look against the paper's formula, one sample after another."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from stationkeep.online import (
    Controller,
    History,
    Learner,
    LearnerSettings,
    Monitor,
    MonitorSample,
    draw_samples,
    run,
)
from stationkeep.online.laws import NormalEquations
from stationkeep.online.learning.monitor import row_margin, row_rank
from stationkeep.online.loop import fixed_points

from .games import TWO_STATE_WEIGHTS, Array, plain, quick_scenario, two_state

START = np.array([0.9, 0.3, 1.5])
POINTS = draw_samples(np.ones(2), 40, seed=0)


def regressors(actor_1: Array, actor_2: Array) -> tuple[Array, Array]:
    """Return ω_j and r_j of the two-state game (R = 1, γ = 2) at the points, by hand."""
    rows, costs = [], []
    for x, y in POINTS:
        c = np.cos(2 * x) + 2
        f = np.array([-x + y, -x / 2 - y / 2 * (1 - 0.75 * c**2)])
        g = np.array([0.0, c])
        jacobian = np.array([[2 * x, 0.0], [y, x], [0.0, 2 * y]])
        u_control = -0.5 * g @ jacobian.T @ actor_1
        u_disturbance = 0.5 / 4.0 * g @ jacobian.T @ actor_2
        rows.append(jacobian @ (f + g * (u_control + u_disturbance)))
        costs.append(x**2 + y**2 + u_control**2 - 4.0 * u_disturbance**2)
    return np.array(rows), np.array(costs)


def looks(settings: LearnerSettings, points: Array, steps: int) -> tuple[Learner, list[MonitorSample]]:
    problem, basis, functions = two_state()
    learner = Learner(problem, basis, settings, POINTS, TWO_STATE_WEIGHTS, START, functions)
    monitor = Monitor(learner, points)
    return learner, [
        monitor.sample(0.1 * i, learner.step(np.array([0.4, -0.3]), 0.1)) for i in range(steps)
    ]


def test_a_look_is_of_the_weights_before_the_step() -> None:
    settings = LearnerSettings.as_printed(gain_actor_1=3.0, gain_actor_2=1.0, leash=0.02)
    (look,) = looks(settings, POINTS, 1)[1]
    omega, cost = regressors(START, START)
    gram = sum(np.outer(row, row) / np.sqrt(1.0 + row @ row) for row in omega)
    eigenvalues = np.linalg.eigvalsh(gram)
    assert look.rank_margin == pytest.approx(eigenvalues[0], rel=1e-9)
    assert look.rank_bound == pytest.approx(eigenvalues[-1], rel=1e-12)
    sizes = np.linalg.norm(omega, axis=1)
    assert look.regressor == pytest.approx(sizes.max())
    assert look.regressor_normalized == pytest.approx((sizes / np.sqrt(1.0 + sizes**2)).max())
    delta = cost + omega @ START
    assert look.fixed_error_max == pytest.approx(np.abs(delta).max())
    relative = delta / np.sum(POINTS**2, axis=1)
    assert look.fixed_error_rms == pytest.approx(np.sqrt(np.mean(relative**2)))
    # weights start at |START| of a bound of three times |W_ref|, critic and actors together
    expected = np.linalg.norm(START) / (3.0 * np.linalg.norm(TWO_STATE_WEIGHTS))
    np.testing.assert_allclose(look.actor_norm, expected)
    np.testing.assert_array_equal(look.actor_distance, 0.0)


def test_the_margin_of_the_rows_is_with_the_state_and_the_leash() -> None:
    """(19) as printed, η_c = 2: the samples, the row at the state, and a leash of 0.02 Σ ω^2/p."""
    settings = LearnerSettings.as_printed(gain_critic=2.0, leash=0.02)
    look = looks(settings, POINTS, 1)[1][0]
    omega, _ = regressors(START, START)
    leashed, _ = regressors(TWO_STATE_WEIGHTS, TWO_STATE_WEIGHTS)
    p = np.sqrt(1.0 + np.sum(leashed**2, axis=1))
    leash = 0.02 * 2.0 * np.diag((leashed**2 / p[:, None]).sum(axis=0))
    x, y = 0.4, -0.3
    c = np.cos(2 * x) + 2
    slope = y / 2 * (1 - 0.75 * c**2)
    push = np.array([[2 * x, 0.0], [y, x], [0.0, 2 * y]])
    rate = np.array([-x + y, -x / 2 - slope - 0.375 * c**2 * (push.T @ START)[1]])
    rows = np.vstack([omega, push @ rate])
    gram = sum(2.0 * np.outer(row, row) / np.sqrt(1.0 + row @ row) for row in rows)
    total = gram + leash
    scaled = total / np.sqrt(np.outer(np.diag(total), np.diag(total)))
    assert look.row_margin == pytest.approx(np.linalg.eigvalsh(scaled)[0], rel=1e-9)
    assert look.row_rank == np.sum(scipy.linalg.eigvalsh(gram, leash) > 1.0) == 3


@pytest.mark.parametrize("part", [1e-3, 0.2])
def test_the_leash_decides_what_the_rows_leave(part: float) -> None:
    """Two rows in six dimensions, a leash of a part of each diagonal entry: it carries the rest."""
    rng = np.random.default_rng(3)
    omega = rng.standard_normal((2, 6)) * 10.0 ** np.arange(6)
    leash = part * np.sum(omega**2, axis=0)
    rows = NormalEquations.of(omega, np.zeros(2), np.ones(2), leash, np.zeros(6))
    assert row_margin(rows) == pytest.approx(part / (1.0 + part), rel=1e-6)
    assert row_rank(rows) == 2
    without = NormalEquations.of(omega, np.zeros(2), np.ones(2), np.zeros(6), np.zeros(6))
    assert row_margin(without) < 1e-12
    assert row_rank(without) == 2
    nothing = NormalEquations.of(omega[:0], np.zeros(0), np.ones(0), np.zeros(6), np.zeros(6))
    assert (row_margin(nothing), row_rank(nothing)) == (0.0, 0)


def test_it_follows_the_actors() -> None:
    settings = LearnerSettings.as_printed(gain_actor_1=3.0, gain_actor_2=1.0)
    learner, found = looks(settings, POINTS, 30)
    margins = [look.rank_margin for look in found]
    assert len(set(margins)) == len(margins)
    exact = np.linalg.eigvalsh(
        sum(
            np.outer(row, row) / np.sqrt(1.0 + row @ row)
            for row in regressors(learner.actor_1, learner.actor_2)[0]
        )
    )[0]
    assert margins[-1] == pytest.approx(exact, rel=0.02)
    gaps = np.array([look.actor_distance for look in found])
    assert np.all(gaps[1:10, 1] > gaps[1:10, 0]), "the slower actor stays farther behind"


def test_without_points_18_has_no_rank() -> None:
    look = looks(plain(), np.zeros((0, 2)), 1)[1][0]
    assert (look.rank_margin, look.rank_bound) == (0.0, 0.0)
    assert np.isnan(look.regressor)
    assert look.row_margin > 0.0


def test_fewer_points_than_weights_have_no_margin() -> None:
    look = looks(plain(), POINTS[:2], 1)[1][0]
    assert look.rank_margin == 0.0 < look.rank_bound


def test_weights_that_are_not_finite_are_looked_at_all_the_same() -> None:
    problem, basis, functions = two_state()
    learner = Learner(problem, basis, plain(leash=0.1), POINTS, TWO_STATE_WEIGHTS, START, functions)
    learner.actor_1 = learner.actor_1 * np.nan
    look = Monitor(learner, POINTS).sample(0.0, learner.observe(np.array([0.4, -0.3])))
    assert np.isnan([look.rank_margin, look.regressor, look.row_margin]).all()
    assert look.row_rank == 0


def test_looking_changes_nothing() -> None:
    settings = plain()
    problem, basis, functions = two_state()
    alone = Learner(problem, basis, settings, POINTS, TWO_STATE_WEIGHTS, START, functions)
    for _ in range(5):
        alone.step(np.array([0.4, -0.3]), 0.1)
    np.testing.assert_array_equal(looks(settings, POINTS, 5)[0].critic, alone.critic)


COSTATE = ("learner.error=costate", "learner.safeguard=true", "simulation.duration=0.6")


def costate_run() -> History:
    return run(quick_scenario(*COSTATE, "simulation.monitor_period=0.001"))


def test_costate_rows_leave_18_alone() -> None:
    """Whatever the critic learns from, (18) is that of the fixed points under the actors."""
    scenario = quick_scenario(*COSTATE)
    first = costate_run().looks[0]
    learner = Controller(scenario).learner
    points = fixed_points(scenario.samples, scenario.station_keeping())
    bellman = quick_scenario("learner.error=bellman", "learner.safeguard=false")
    residual = Controller(bellman).learner.sample_residual()
    assert points.shape == (200, 12)
    normalizer = np.sqrt(1.0 + np.sum(residual.omega**2, axis=1))
    singular = np.linalg.svd(residual.omega / np.sqrt(normalizer)[:, None], compute_uv=False)
    assert first.rank_margin == pytest.approx(singular[-1] ** 2, rel=1e-6)
    assert first.rank_margin > 0.0
    np.testing.assert_array_equal(learner.actor_1, learner.reference)
