"""The paper's claim: with sample points the weights converge, without persistence of excitation."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from stationkeep.comparison.study import ExcitationRun, excitation
from stationkeep.comparison.study.excitation import PLAIN, excitation_runs, fixed_point
from stationkeep.online import draw_samples
from stationkeep.symbolic import Basis, Problem

from .games import Array, linear_quadratic, quick_scenario


@cache
def runs() -> dict[str, list[ExcitationRun]]:
    """Return short runs; the vehicle's own reference weights are left to the slow test."""

    def riccati(problem: Problem, basis: Basis, *_: object) -> Array:
        return basis.quadratic_weights(problem.P)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(excitation, "fixed_point", riccati)
        return excitation_runs(quick_scenario(), n_samples=300, duration=8.0)


def every_run() -> list[ExcitationRun]:
    return [run for group in runs().values() for run in group]


def test_both_plants_with_and_without_samples() -> None:
    assert set(runs()) == {"linearised vehicle", "vehicle"}
    for group in runs().values():
        assert [run.n_samples for run in group] == [0, 0, 300]
        assert {run.n_basis for run in group} == {78}


def test_no_trajectory_is_persistently_exciting() -> None:
    for run in every_run():
        assert run.excited.max() < 40 < run.n_basis, run.name
        assert np.all(run.excited >= 1.0)


def test_samples_make_the_weights_converge() -> None:
    """On the linearised vehicle the right weights are those of ζ'P ζ, exactly."""
    with_samples = runs()["linearised vehicle"][-1]
    assert with_samples.stopped is None
    assert with_samples.weight_error[0] == pytest.approx(0.5)
    assert with_samples.weight_error[-1] < 1e-6
    assert np.all(with_samples.rank_margin > 0.0)


def test_without_samples_they_do_not() -> None:
    for run in every_run():
        if run.n_samples == 0:
            assert run.weight_error.min() > 0.4, run.name
            np.testing.assert_array_equal(run.rank_margin, 0.0)


def test_the_cautious_run_without_samples_goes_on_to_the_end() -> None:
    """That it doesn't converge is no matter of a run that was lost early."""
    for group in runs().values():
        cautious = group[1]
        assert cautious.stopped is None
        assert cautious.time[-1] == pytest.approx(8.0)
        assert cautious.excited[-1] > cautious.excited[0]


def test_series_have_one_length() -> None:
    for run in every_run():
        lengths = {len(run.time), len(run.excited), len(run.rank_margin), len(run.weight_error)}
        assert len(lengths) == 1
        assert np.all(np.diff(run.time) > 0.0)


@pytest.mark.slow
def test_the_fixed_point_of_the_linear_game_is_its_riccati_solution() -> None:
    problem, basis, _ = linear_quadratic()
    settings = quick_scenario().learner.model_copy(update=PLAIN)
    samples = draw_samples(0.3 * problem.scale, 120, 3)
    weights = fixed_point(problem, basis, settings, samples)
    expected = basis.quadratic_weights(problem.P)
    assert np.linalg.norm(weights - expected) < 1e-6 * np.linalg.norm(expected)


@pytest.mark.slow
def test_the_claim_as_compare_draws_it() -> None:
    """The default settings over 30 s, on the vehicle against the fixed point of many samples."""
    for label, (without, cautious, converged) in excitation_runs(quick_scenario()).items():
        assert converged.weight_error[0] > 0.4
        assert converged.weight_error[-1] < (1e-6 if label == "linearised vehicle" else 0.1)
        assert converged.rank_margin.min() > 0.0
        assert min(without.weight_error.min(), cautious.weight_error.min()) > 0.4
        for run in (without, cautious, converged):
            assert run.excited.max() < run.n_basis
