"""Learning from wrong weights: half of the right ones, another vehicle's, and zero."""

from __future__ import annotations

from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from stationkeep.comparison import Scenario
from stationkeep.offline import QuickValue
from stationkeep.online import Controller, Learner, LearnerSettings, draw_samples
from stationkeep.symbolic import InputError, Model, Vehicle
from studies.cases import Case
from studies.kept import Keep
from studies.lesson import lesson
from studies.recovery import (
    Recovery,
    half_added_mass,
    rank_and_margin,
    recoveries,
    regressors,
    remembered_regret,
    time_within,
)

from .games import (
    HALF_WIDTHS,
    TWO_STATE_WEIGHTS,
    Array,
    linear_quadratic,
    quick_scenario,
    two_state,
)

COSTATE = ("learner.error=costate", "learner.safeguard=true", "learner.steps=100")


def two_state_learner(start: Array, leash: float) -> Learner:
    """Return a learner that knows nothing but its start: the reference is the start too."""
    problem, basis, functions = two_state()
    settings = LearnerSettings(steps=400, leash=leash)
    return Learner(problem, basis, settings, np.zeros((0, 2)), start, start, functions)


@pytest.mark.parametrize("factor", [0.5, 0.6, 2.0])
def test_a_wrong_multiple_learns_the_exact_weights(factor: float) -> None:
    """W* = (1/2, 0, 1) of the two-state game, P/2 being on the edge of the gain margin (1/2, ∞)."""
    start = factor * TWO_STATE_WEIGHTS
    taught = two_state_learner(start, leash=1e-6)
    zeta = np.array([0.8, -1.0])
    value = zeta[0] ** 2 / 2 + zeta[1] ** 2
    before = taught.predicted_cost(zeta, start, start)
    assert before > 1.05 * value
    for _ in range(40):
        taught.step(zeta, 0.25)
    np.testing.assert_allclose(taught.critic, TWO_STATE_WEIGHTS, atol=2e-3)
    reached = taught.predicted_cost(zeta, taught.actor_1, taught.actor_2)
    assert reached == pytest.approx(value, rel=1e-5)


def test_a_leash_to_wrong_weights_keeps_a_part_of_the_error() -> None:
    """A ridge of strength ρ Σ w ω^2 leaves about ρ / (1 + ρ) of the way."""
    errors = []
    for leash in (0.01, 0.1):
        taught = two_state_learner(0.5 * TWO_STATE_WEIGHTS, leash)
        for _ in range(40):
            taught.step(np.array([0.8, -1.0]), 0.25)
        errors.append(abs(taught.critic[2] - 1.0))
    assert 1e-3 < errors[0] < 0.5 * errors[1] < 0.1


def test_costates_find_the_riccati_solution_from_half_of_it() -> None:
    problem, basis, functions = linear_quadratic()
    exact = basis.quadratic_weights(problem.P)
    settings = LearnerSettings(steps=100, leash=0.0)
    start = 0.5 * exact
    taught = Learner(problem, basis, settings, np.zeros((0, 12)), start, start, functions)
    zeta = 0.3 * HALF_WIDTHS * np.random.default_rng(3).uniform(-1.0, 1.0, 12)
    value = zeta @ problem.P @ zeta
    assert taught.predicted_cost(zeta, start, start) > 1.01 * value
    for _ in range(12):
        taught.step(zeta, 0.25)
    reached = taught.predicted_cost(zeta, taught.actor_1, taught.actor_2)
    assert reached == pytest.approx(value, rel=1e-4)


def test_reference_is_the_right_solution_or_the_start() -> None:
    half = "learner.weight_factor=0.5"
    riccati = quick_scenario().station_keeping().riccati_weights
    for overrides, reference in (((half,), 1.0), ((half, "learner.reference=initial"), 0.5)):
        learner = Controller(quick_scenario(*overrides)).learner
        np.testing.assert_array_equal(learner.actor_1, 0.5 * riccati)
        np.testing.assert_array_equal(learner.reference, reference * riccati)
        assert learner.projection.bound == pytest.approx(3.0 * reference * np.linalg.norm(riccati))


def test_with_its_start_as_reference_a_learner_does_not_fall_back_to_the_right_one() -> None:
    state = np.array([0.3, 0.2, -0.1, 0.0, 0.05, 0.2, 0, 0, 0, 0, 0, 0])
    fell_back = []
    for reference in ("riccati", "initial"):
        overrides = ("learner.weight_factor=0.5", f"learner.reference={reference}")
        learner = Controller(quick_scenario(*COSTATE, *overrides)).learner
        start = (learner.actor_1, learner.actor_2)
        fell_back.append(learner.guard.certified(state, start).restarted)
    assert fell_back == [True, False]


def test_weights_of_another_vehicle_are_its_riccati_solution(tmp_path: Path) -> None:
    scenario = quick_scenario()
    station = scenario.station_keeping()
    path = half_added_mass(station.model.vehicle, tmp_path)
    other = Vehicle.load(path)
    expected = 0.5 * np.array(station.model.vehicle.added_mass)
    np.testing.assert_array_equal(other.added_mass, expected)
    unchanged = station.model.vehicle.model_dump(exclude={"name", "added_mass"})
    assert other.model_dump(exclude={"name", "added_mass"}) == unchanged
    weights = quick_scenario(f"learner.weights_vehicle={path}").initial_weights()
    assert weights is not None
    # an independent solver, on the linearisation of the other vehicle
    A, B = Model(other, compiled=False).problem(station.game, station.half_widths).linearization
    P = scipy.linalg.solve_continuous_are(A, B, station.game.Q, station.game.R_eff)
    for zeta in draw_samples(station.envelope, 5, 3):
        value = weights @ station.functions.sigma(zeta)[0]
        assert value == pytest.approx(zeta @ P @ zeta, rel=1e-7)
        assert value != pytest.approx(zeta @ station.problem.P @ zeta, rel=1e-3)
    halved = quick_scenario(f"learner.weights_vehicle={path}", "learner.weight_factor=0.5")
    start = Controller(halved).learner.actor_1
    np.testing.assert_allclose(start, 0.5 * weights, rtol=1e-12)


def test_the_own_vehicle_named_is_the_own_solution() -> None:
    weights = quick_scenario("learner.weights_vehicle=bluerov2-heavy").initial_weights()
    np.testing.assert_allclose(
        weights, quick_scenario().station_keeping().riccati_weights, rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("learner.weights_vehicle=bluerov",), ["no vehicle 'bluerov'", "bluerov2-heavy"]),
        (("learner.weights_vehicle=none.toml",), ["no file", "none.toml"]),
        (
            ("learner.weights_vehicle=rexrov", "learner.weights=a.nc"),
            ["weights_vehicle is 'rexrov'", "'a.nc'", 'weights = "riccati"'],
        ),
        (("learner.reference=right",), ["learner.reference", "'right'", "riccati", "initial"]),
        (
            ("learner.reference=initial", "learner.weight_factor=0"),
            ["learner.reference is 'initial'", "zero", 'learner.reference = "riccati"'],
        ),
    ],
)
def test_bad_starts_are_one_sentence(
    overrides: tuple[str, ...], words: list[str], one_sentence: object
) -> None:
    with pytest.raises(InputError) as caught:
        Controller(quick_scenario(*overrides))
    sentence = one_sentence(caught.value)  # type: ignore[operator]
    for word in words:
        assert word in sentence


def test_rank_of_zero_actors_is_what_the_drift_alone_leaves() -> None:
    """ω = σ'A ζ of X -> A'X + XA: the rank of (18) is that of the Lyapunov operator, 60 of 78."""
    problem, basis, functions = linear_quadratic()
    A, _ = problem.linearization
    pairs = list(combinations_with_replacement(range(12), 2))
    operator = []
    for i, j in pairs:
        X = np.zeros((12, 12))
        X[i, j] += 0.5
        X[j, i] += 0.5
        change = A.T @ X + X @ A
        operator.append([change[a, b] * (1.0 if a == b else 2.0) for a, b in pairs])
    expected = np.linalg.matrix_rank(np.array(operator))
    points = draw_samples(HALF_WIDTHS, 300, 1)
    zero = np.zeros(basis.n_basis)
    rank, margin = rank_and_margin(regressors(problem, basis, functions, points, zero))
    assert (rank, margin) == (expected, 0.0) == (60, 0.0)
    exact = basis.quadratic_weights(problem.P)
    rows = regressors(problem, basis, functions, points, exact)
    rank, margin = rank_and_margin(rows)
    assert rank == 78
    assert margin == pytest.approx(np.linalg.eigvalsh(rows.T @ rows)[0], rel=1e-6)


def test_zero_weights_are_kept_stable_by_the_safeguard() -> None:
    learner = Controller(quick_scenario(*COSTATE, "learner.weight_factor=0")).learner
    state = np.array([0.3, 0.2, -0.1, 0.0, 0.05, 0.2, 0.1, 0, 0, 0, 0, 0])
    linear = learner.predicted_cost(state, learner.reference, learner.reference)
    seen = learner.step(state, 0.25)
    assert seen.predicted_cost == linear
    assert learner.predicted_cost(state, learner.actor_1, learner.actor_2) <= linear


def test_time_within() -> None:
    times = np.array([0.0, 1.0, 2.0, 3.0])
    for regrets, expected in (
        ([1, 1, 1, 1], 0.0),
        ([3, 1, 1, 1], 1.0),
        ([1, 3, 1, 1], 2.0),
        ([3, 1, 1, 3], np.inf),
        ([np.nan, 1, 1, 1], 1.0),
    ):
        assert time_within(times, np.array(regrets, dtype=float), 2.0) == expected
    assert Recovery(times, np.array([4, 2.1, 1, 0]), np.array([2, 2, 1, -1.0]), 5.0).seconds == 1.0
    assert Recovery(times, np.array([4, 2.3, 1, 0]), np.array([2, 2, 1, -1.0]), 5.0).seconds == 2.0


@pytest.mark.slow
def test_a_right_start_has_nothing_to_recover_from(tmp_path: Path) -> None:
    """Beside itself a learner is at no time worse; from P/2 it is, before it learns."""
    scenario = quick_scenario(*COSTATE)
    state = scenario.station_keeping().envelope * np.random.default_rng(4).uniform(-1, 1, 12)
    keep = Keep(tmp_path / "recoveries.jsonl")
    (same,) = recoveries(scenario, Case("right"), state[None, :], keep)
    np.testing.assert_array_equal(same.wrong, same.right)
    assert same.seconds == 0.0
    assert same.times[0] == 0.0
    assert np.diff(same.times) == pytest.approx(0.26)  # a control period more than 0.25 s
    half = {"learner": {"weight_factor": 0.5, "reference": "initial"}}
    (wrong,) = recoveries(scenario, Case("half", changes=half), state[None, :], keep)
    assert wrong.before > 2.0 * same.before > 0.0
    assert wrong.wrong[-1] < 0.1 * wrong.before
    assert wrong.seconds > 0.0
    assert wrong.times[-1] < 2.0  # the scenario's duration, shorter than what is watched


def test_a_lesson_is_a_run_and_what_it_remembered(tmp_path: Path) -> None:
    scenario = quick_scenario(*COSTATE, "simulation.duration=3")
    station = scenario.station_keeping()
    case = Case("half", changes={"learner": {"weight_factor": 0.5, "reference": "initial"}})
    taught = lesson(scenario, case, station.envelope * 0.5, tmp_path)
    assert taught.stopped is None
    np.testing.assert_allclose(taught.times, [0.0, 1.0, 2.0, 3.0], atol=0.021)
    np.testing.assert_array_equal(taught.weights[0], 0.5 * station.riccati_weights)
    kept = scenario.with_settings(learner={"weights": str(taught.path)}).initial_weights()
    assert not np.array_equal(kept, taught.weights[0])
    written = taught.path.stat().st_mtime_ns
    again = lesson(scenario, case, station.envelope * 0.5, tmp_path)
    assert taught.path.stat().st_mtime_ns == written
    np.testing.assert_array_equal(again.weights, taught.weights)
    states = draw_samples(station.envelope, 3, 8)
    optimum = QuickValue(station.problem)
    medians = remembered_regret(scenario, taught, states, np.array([optimum(z) for z in states]))
    assert medians[-1] < medians[0]
    assert np.all(medians > 0.0)


def test_starts_of_a_shipped_scenario_are_known_by_name() -> None:
    scenario = Scenario.load("bluerov2-heavy", ["learner.weights_vehicle=bluerov2-heavy-2024"])
    assert scenario.learner.weights == "riccati"
    assert scenario.learner.reference == "riccati"
