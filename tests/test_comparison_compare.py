"""`compare` as a function, of a problem that is no vehicle: the two-state game with its known value."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario, Study, check, compare
from stationkeep.comparison.merit import Regret, RunMetrics
from stationkeep.comparison.report import summary
from stationkeep.comparison.report.figures import groups_by_unit
from stationkeep.comparison.study import Field
from stationkeep.comparison.study.reference import ClairvoyantOptimum, GameOptimum, Optimum
from stationkeep.symbolic import InputError, two_state_game

from .games import TWO_STATE_WEIGHTS, Array

Check = Callable[[BaseException], str]
POLICIES = {"learned", "linear", "lqr", "quadratic", "gradient"}  # no PID, and no inverse dynamics
FIGURES = {
    *("regret", "states", "cost", "controls", "errors", "weights", "bellman", "monitor", "field"),
    "excitation",
}


def value(zeta: Array) -> Array:
    """V* = x1^2 / 2 + x2^2."""
    return np.asarray(zeta**2 @ np.array([0.5, 1.0]))


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    path = tmp_path_factory.mktemp("problem") / "mine.py"
    path.write_text(
        "from stationkeep.symbolic import two_state_game\nproblem = two_state_game()\n",
        encoding="utf-8",
    )
    return Scenario.load(f"{path}:problem", ["samples.number=100"])


@pytest.fixture(scope="module")
def study(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Study:
    return compare(scenario, states=2, out=tmp_path_factory.mktemp("study"))


def test_the_optimum_is_the_closed_form(study: Study, scenario: Scenario) -> None:
    assert study.optimal.attrs["value"] == pytest.approx(value(scenario.initial_state), rel=1e-8)
    assert study.value_error < 1e-8
    assert study.n_states == 2
    assert study.faults == []


def test_every_policy_costs_more_and_the_learned_one_least(study: Study) -> None:
    """Its weights are the ideal ones from the start: what is left is that the control is held."""
    assert study.regret is not None
    assert set(study.regret) == set(study.metrics) == POLICIES
    for name, regret in study.regret.items():
        assert regret.diverged == 0
        assert regret.median > -1e-6, name
    assert study.regret["learned"].median < 0.01 < study.regret["linear"].median
    cost = study.metrics["linear"].cost
    assert cost is not None
    expected = cost / float(value(study.scenario.initial_state)) - 1.0
    assert study.metrics["linear"].regret == pytest.approx(expected, abs=1e-8)


def test_errors_along_the_way_against_the_closed_form(study: Study) -> None:
    learned, analysis = study.records["learned"], study.analysis
    zeta = learned.sel(time=analysis["time"])["zeta"].values
    np.testing.assert_allclose(analysis["value"], value(zeta), rtol=1e-5)
    # u_1 of the linear policy has c = 3 of the origin where the optimal one has cos(2 x1) + 2
    c = np.cos(2.0 * zeta[:, 0]) + 2.0
    np.testing.assert_allclose(analysis["policy_error_linear"], np.abs(3.0 - c) / c, atol=2e-5)
    scale = study.setup.half_widths
    scaled = TWO_STATE_WEIGHTS * np.array([scale[0] ** 2, scale[0] * scale[1], scale[1] ** 2])
    np.testing.assert_allclose(analysis["ideal_weights"], scaled, atol=1e-4)


def test_the_field_is_zero_and_has_a_hole_at_the_origin(study: Study) -> None:
    """The residual of (7) is exactly zero for V*; at the origin itself 0/0 is not known."""
    field = study.analysis["field_linear"].values
    assert np.isnan(field).sum() == 1
    assert np.isnan(field[20, 20])
    assert np.nanmax(np.abs(field)) < 1e-10


def test_the_size_of_a_run_is_that_of_the_scaled_state(study: Study) -> None:
    zeta = study.records["lqr"]["zeta"].values
    squares = [(x1 / 2.0) ** 2 + (x2 / 2.0) ** 2 for x1, x2 in zeta]
    assert study.scaled_rms["lqr"] == pytest.approx(np.sqrt(sum(squares) / len(squares)))
    run = study.metrics["lqr"]
    assert (run.position_rms, run.effort, run.energy, run.peak_thrust) == (None, None, None, None)


@pytest.mark.slow
def test_a_report_of_a_problem_says_nothing_of_vehicles(study: Study) -> None:
    report = study.write_report()
    assert report == study.out / "report.html"
    assert set(study.figures) == FIGURES
    for path in study.figures.values():
        assert path.read_bytes().startswith(b"\x89PNG")
    text = re.sub(r"base64,[A-Za-z0-9+/=]+", "", report.read_text(encoding="utf-8"))
    text = text.partition("<h2>Do it again</h2>")[0]
    assert "two-state game goes back to the origin" in text
    for word in ("vehicle", "station", "wrench", "energy", "pitch", "earth", "[m"):
        assert word not in text.lower(), word


@pytest.mark.slow
def test_a_second_call_reuses_the_records(study: Study) -> None:
    before = {path: path.stat().st_mtime_ns for path in (study.out / "records").iterdir()}
    again = compare(study.scenario, states=2, out=study.out)
    assert again.regret == study.regret
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_check_of_a_run(study: Study, scenario: Scenario, one_sentence: Check) -> None:
    """Read from the record alone, and of the scenario given: the same rows, none of a vehicle's."""
    record = study.records["learned"]
    rows = check(scenario, record)
    assert rows[0].name == "f(0) = 0"
    assert not any("M_bar" in row.name or "pitch" in row.name for row in rows)
    assert "the run stays in χ" in [row.name for row in rows]
    with pytest.raises(InputError, match="another scenario") as caught:
        check(scenario.with_settings(samples={"number": 7}), record)
    one_sentence(caught.value)
    with pytest.raises(InputError, match="nothing to check") as caught:
        check()
    one_sentence(caught.value)


def test_there_is_no_film_of_a_problem(study: Study, one_sentence: Check) -> None:
    with pytest.raises(InputError, match="two-state game") as caught:
        study.animate()
    one_sentence(caught.value)


@pytest.mark.parametrize(("name", "number"), [("states", 0), ("workers", -1)])
def test_numbers_must_be_positive(
    name: str, number: int, scenario: Scenario, tmp_path: Path, one_sentence: Check
) -> None:
    with pytest.raises(InputError, match=f"{name} is {number}") as caught:
        compare(scenario, out=tmp_path, **{name: number})  # type: ignore[arg-type]
    one_sentence(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_field_by_name_and_by_number(one_sentence: Check) -> None:
    problem = two_state_game()
    first, second = problem.state_names
    assert Field.of(None, problem) == Field(0, 1)
    assert Field.of(f"{second},{first}", problem) == Field.of("2,1", problem) == Field(1, 0)
    for text in (f"{first},{first}", f"{first},1", first, "1,2,2"):
        with pytest.raises(InputError, match="two different states") as caught:
            Field.of(text, problem)
        one_sentence(caught.value)
    with pytest.raises(InputError, match="no state 'psi'") as caught:
        Field.of("psi,1", problem)
    one_sentence(caught.value)


def test_states_of_one_unit_are_together() -> None:
    assert groups_by_unit(("m", "rad", "m", "1")) == [[0, 2], [1], [3]]
    assert groups_by_unit(("1",) * 8) == [[0, 1, 2, 3, 4, 5], [6, 7]]


RUN = RunMetrics(
    cost=110.0,
    running_cost=100.0,
    regret=0.1,
    position_rms=None,
    excursion=None,
    effort=None,
    energy=None,
    saturated=None,
    policy_microseconds=None,
    policy_mean=None,
    rest_share=0.01,
    peak_thrust=None,
    stopped=None,
)


def test_what_runs_are_held_against(study: Study) -> None:
    """The game's cost has the rest, the clairvoyant's does not; a run below either is a fault."""
    record, optima = study.optimal, [Optimum(100.0, 1e-6)]
    game, clairvoyant = GameOptimum(record, optima), ClairvoyantOptimum(record, optima)
    assert (game.cost(RUN), clairvoyant.cost(RUN)) == (110.0, 100.0)
    assert (game.too_short(RUN), clairvoyant.too_short(RUN)) == (True, False)
    cheaper = {"lqr": dataclasses.replace(RUN, regret=-0.02), "linear": RUN}
    (doubt,) = game.doubts(0, cheaper)
    assert doubt.startswith("LQR: its regret is -2.0e-02, below zero by more than the error 1e-06")
    within = {"lqr": dataclasses.replace(RUN, regret=-5e-7)}
    assert game.doubts(0, within) == []
    uncertain = {"lqr": dataclasses.replace(RUN, regret=-0.02, cost_error=0.03)}
    assert game.doubts(0, uncertain) == []
    assert clairvoyant.doubts(0, cheaper) == ["clairvoyant optimum: the run of LQR costs 2 % less"]
    assert not ClairvoyantOptimum(None, optima).known


def test_verdicts_with_and_without_an_optimum(study: Study) -> None:
    record, optima = study.optimal, [Optimum(100.0, 1e-6)]
    runs = {"learned": RUN, "linear": dataclasses.replace(RUN, regret=0.2, running_cost=125.0)}
    regrets = {"learned": Regret.of([0.1]), "linear": Regret.of([0.2])}
    game = GameOptimum(record, optima).verdict(regrets, runs)
    assert "10.000 % more than the optimum;" in game
    assert "takes 50 % off" in game
    seen = ClairvoyantOptimum(record, optima).verdict(regrets, runs)
    assert "10.00 % more than it, the linear H-infinity policy 20.00 %" in seen
    unseen = ClairvoyantOptimum(None, optima).verdict(None, runs)
    assert "costs 20.0 % less than the linear" in unseen  # 100 against 125
    lost = {**regrets, "learned": Regret.of([None])}
    assert "ended early" in GameOptimum(record, optima).verdict(lost, runs)


def test_a_failed_run_is_infinite_in_the_table(study: Study) -> None:
    """The median of a finished and a failed run is the upper one, and no number."""
    failed = dataclasses.replace(RUN, cost=None, running_cost=None, regret=None, stopped="lost")
    runs = {name: list(runs) for name, runs in study.all_metrics.items()}
    runs["lqr"][1] = failed
    header, rows = summary(dataclasses.replace(study, all_metrics=runs))
    (row,) = [row for row in rows if row[0] == "LQR"]
    told = dict(zip(header, row, strict=True))
    assert (told["median [%]"], told["worst [%]"]) == ("∞", "∞")
    assert told["ended early"] == "1 of 2: lost"
