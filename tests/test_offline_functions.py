"""What the commands do as functions of a problem: in closed form, and the same as the commands say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from casadi import DM
from stationkeep.comparison import Scenario
from stationkeep.offline import (
    OfflineSettings,
    OfflineSolver,
    Pairs,
    fit_weights,
    gamma_curve,
    saddle_gap,
    solve,
    worst_case,
)
from stationkeep.symbolic import InputError

from .commands import LOOSE, QUICK, ROUGH, call, sets
from .games import FAR_STATE, TWO_STATE_WEIGHTS, Array, linear_quadratic, two_state

Capture = pytest.CaptureFixture[str]
STATE = np.array([0.3, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0, 0])
AT = ("--state", ",".join(f"{entry:g}" for entry in STATE))
ZETA = np.array([1.0, -0.7])


def value(zeta: Array) -> float:
    """V* of the two-state game."""
    return float(zeta[0] ** 2 / 2.0 + zeta[1] ** 2)


def test_saddle_gap_of_the_two_state_game_encloses_its_value() -> None:
    found = saddle_gap(two_state()[0], ZETA, OfflineSettings(horizon=25.0))
    assert found.value == pytest.approx(value(ZETA), rel=1e-7)
    assert found.upper == pytest.approx(value(ZETA), rel=1e-6)
    assert found.lower == pytest.approx(value(ZETA), rel=1e-6)
    assert found.holds


def test_worst_case_of_the_optimal_policy_costs_the_value() -> None:
    """u_1 = -1/2 R^-1 g'V_ζ with V_ζ = (ζ_1, 2 ζ_2), and no policy does better."""
    problem, _, _ = two_state()
    costate = DM([[1.0, 0.0], [0.0, 2.0]]) @ problem.zeta
    optimal = -0.5 * DM(problem.game.R_inverse) @ (problem.input_matrix.T @ costate)
    found = worst_case(problem, ZETA, optimal)
    assert found.cost == pytest.approx(value(ZETA), rel=1e-5)
    assert worst_case(problem, ZETA).cost > value(ZETA) * (1.0 + 1e-4)


def test_worst_case_of_the_linear_policy_in_a_linear_game_is_its_value() -> None:
    problem, _, _ = linear_quadratic()
    found = worst_case(problem, FAR_STATE)
    assert found.cost == pytest.approx(FAR_STATE @ problem.P @ FAR_STATE, rel=1e-5)


def test_gamma_curve_at_its_own_level_is_the_value() -> None:
    problem, _, _ = two_state()
    curve = gamma_curve(problem, ZETA, [float(problem.game.gamma)])
    assert curve.points[0].value == pytest.approx(value(ZETA), rel=1e-8)


def test_pairs_of_certified_optima_give_the_ideal_weights() -> None:
    problem, basis, _ = two_state()
    solver = OfflineSolver(problem)
    states = np.random.default_rng(5).uniform(-1.0, 1.0, (6, 2))
    pairs = Pairs.of(solver.solve(zeta) for zeta in states)
    np.testing.assert_array_equal(pairs.states, states)
    np.testing.assert_allclose(pairs.gradients, states * [1.0, 2.0], atol=1e-6)
    np.testing.assert_allclose(fit_weights(basis, pairs).weights, TWO_STATE_WEIGHTS, atol=1e-6)


def test_an_optimum_with_faults_makes_no_pair() -> None:
    problem, _, _ = two_state()
    rough = solve(problem, ZETA, OfflineSettings(horizon=20.0, intervals=2, degree=1, rounds=1))
    assert rough.faults
    with pytest.raises(InputError, match=r"not certified: value_error is .*; leave it out"):
        Pairs.of([rough])


@pytest.mark.slow
def test_the_command_gives_the_curve_of_the_function(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = (*QUICK, *ROUGH, *LOOSE)
    answer = call(capsys, "offline", *AT, *sets(*settings), "--gammas", "5,2", "--json", "--quiet")
    assert answer.code == 0, answer.err
    (row,) = answer.json()["states"]
    scenario = Scenario.load("bluerov2-heavy", settings)
    problem = scenario.station_keeping().problem
    curve = gamma_curve(problem, STATE, [2.0, 5.0], scenario.offline)
    assert [point["value"] for point in row["gamma_curve"]] == [p.value for p in curve.points]
    assert [point["slope"] for point in row["gamma_curve"]] == [p.slope for p in curve.points]
    assert row["undisturbed_value"] == curve.undisturbed.value


@pytest.mark.slow
def test_the_command_gives_the_gap_and_the_worst_case_of_the_functions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = ("basis.name=quadratic",)
    answer = call(capsys, "offline", *AT, *sets(*settings), "--saddle", "--json", "--quiet")
    assert answer.code == 0, answer.err
    (row,) = answer.json()["states"]
    scenario = Scenario.load("bluerov2-heavy", settings)
    problem = scenario.station_keeping().problem
    gap = saddle_gap(problem, STATE, scenario.offline)
    told = row["saddle"]
    assert (told["upper"], told["lower"], told["gap"]) == (gap.upper, gap.lower, gap.gap)
    linear, case = row["worst_case"]["linear"], worst_case(problem, STATE)
    assert (linear["cost"], linear["excess"]) == (case.cost, case.excess(row["value"]))
