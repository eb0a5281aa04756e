"""The certificate: it holds for the shipped settings, and is no smaller than the true error."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from stationkeep.offline import (
    Certificate,
    DirectSolver,
    OfflineSettings,
    OfflineSolution,
    OfflineSolver,
    solve,
)
from stationkeep.symbolic import Problem

from .games import (
    FAR_STATE,
    FAR_VALUE,
    FAST_STATE,
    FAST_VALUE,
    HALF_WIDTHS,
    Array,
    linear_quadratic,
    two_state,
)

EASY = OfflineSettings(horizon=20.0, intervals=20, grading=3.0)


@pytest.fixture(scope="module")
def certified(reference_problem: Problem) -> OfflineSolution:
    """The shipped settings."""
    return OfflineSolver(reference_problem, OfflineSettings()).solve(FAR_STATE)


@pytest.mark.slow
def test_certificate_holds(certified: OfflineSolution) -> None:
    assert certified.faults == []
    assert certified.value == pytest.approx(FAR_VALUE, rel=1e-10)
    certificate = certified.certificate
    print(certificate)
    assert certificate.value_error < 1e-9
    assert certificate.horizon_error < certificate.value_error
    assert certificate.defect < 1e-6
    assert certificate.hji_residual < 1e-8
    assert certificate.costate_error < 1e-6
    assert certified.seconds > certified.direct.seconds > 0.0
    np.testing.assert_array_equal(certified.costate, certified.direct.costate)


@cache
def fast_costate(problem: Problem) -> Array:
    """The costate at the fast state, by 80 aligned intervals; 40 agree with it to 1e-10."""
    direct = DirectSolver(problem, horizon=120.0, n_intervals=80)
    return direct.solve_aligned(FAST_STATE)[0].costate


@pytest.mark.slow
@pytest.mark.parametrize(("intervals", "aligned"), [(10, True), (20, False)])
def test_certificate_bounds_the_true_value_error(
    reference_problem: Problem, intervals: int, aligned: bool
) -> None:
    """Coarse solves: their value is as far off as they say, or less, and they say that it is far."""
    settings = OfflineSettings(horizon=120.0, intervals=intervals, degree=5, aligned=aligned, rounds=1)
    answer = OfflineSolver(reference_problem, settings).solve(FAST_STATE)
    error = abs(answer.value - FAST_VALUE) / FAST_VALUE
    print(f"K={intervals} aligned={aligned}: true value error {error:.1e}, {answer.certificate}")
    assert 1e-9 < error < answer.certificate.value_error
    assert answer.faults


@pytest.mark.slow
@pytest.mark.parametrize(("intervals", "aligned"), [(10, True), (20, False)])
def test_certificate_bounds_the_true_costate_error(
    reference_problem: Problem, intervals: int, aligned: bool
) -> None:
    """A costate can be the gradient of the value on its mesh and still be wrong with the mesh."""
    settings = OfflineSettings(horizon=120.0, intervals=intervals, degree=5, aligned=aligned, rounds=1)
    answer = OfflineSolver(reference_problem, settings).solve(FAST_STATE)
    exact = fast_costate(reference_problem)
    gap = np.linalg.norm((answer.costate - exact) * HALF_WIDTHS)
    error = gap / np.linalg.norm(exact * HALF_WIDTHS)
    print(f"K={intervals} aligned={aligned}: true costate error {error:.1e}, {answer.certificate}")
    assert error < 10.0 * answer.certificate.costate_error


def test_certificates_of_games_with_known_value() -> None:
    linear = linear_quadratic()[0]
    for problem, zeta0, exact in (
        (two_state()[0], np.array([1.0, -0.7]), 0.99),
        (linear, FAR_STATE, float(FAR_STATE @ linear.P @ FAR_STATE)),
    ):
        answer = solve(problem, zeta0, EASY)
        assert answer.faults == [], answer.faults
        assert answer.value == pytest.approx(exact, rel=2.0 * EASY.value_tolerance)
        assert abs(answer.value - exact) / exact <= answer.certificate.value_error + 1e-9


def test_too_coarse_a_solve_fails_its_certificate() -> None:
    """On three intervals of degree 2 the value is off, and IPOPT is content."""
    coarse = OfflineSettings(horizon=20.0, intervals=3, degree=2, grading=3.0)
    answer = solve(two_state()[0], np.array([1.0, -0.7]), coarse)
    error = abs(answer.value - 0.99) / 0.99
    assert error > 1e-4
    assert error <= answer.certificate.value_error
    assert any(fault.startswith("value_error") for fault in answer.faults)
    assert any(fault.startswith("defect") for fault in answer.faults)


def test_too_short_a_horizon_fails_its_certificate(reference_problem: Problem) -> None:
    short = OfflineSettings(horizon=1.0, intervals=12, grading=1.0)
    answer = solve(reference_problem, FAR_STATE, short)
    assert answer.certificate.horizon_error > 1e-3
    assert any(fault.startswith("value_error") for fault in answer.faults)


@pytest.mark.parametrize("game", ["two states", "linear", "shipped"])
def test_certificate_at_the_origin(game: str, reference_problem: Problem) -> None:
    """Nothing to do costs nothing, and that is certain."""
    games = {
        "two states": two_state()[0],
        "linear": linear_quadratic()[0],
        "shipped": reference_problem,
    }
    answer = solve(games[game], np.zeros(games[game].n_states), EASY)
    assert answer.value == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(answer.costate, 0.0, atol=1e-6)
    assert answer.faults == [], answer.faults


def test_faults_name_what_breaks_its_tolerance() -> None:
    settings = OfflineSettings()
    good = Certificate(
        value_error=1e-7,
        defect=1e-7,
        hji_residual=1e-7,
        costate_error=1e-5,
        horizon_error=1e-9,
        refinement_error=1e-8,
        integration_error=1e-8,
        disagreement=1e-9,
        second_order=True,
        gradient_unique=True,
    )
    assert good.faults(settings) == []
    bad = replace(
        good, value_error=2e-6, hji_residual=float("nan"), costate_error=1e-3, second_order=False
    )
    faults = bad.faults(settings)
    assert len(faults) == 4
    assert faults[0] == "value_error is 2.0e-06, over 1e-07"
    assert faults[1] == "hji_residual is not known"
    assert faults[2].startswith("costate_error is 1.0e-03")
    assert "conjugate point" in faults[3]


def test_the_same_state_gives_the_same_bits() -> None:
    """Whatever was solved before it; the certificate goes through the interpolation of the guess."""
    problem, _, _ = two_state()
    solver = OfflineSolver(problem, EASY)
    first = solver.solve(np.array([1.0, -0.7]))
    solver.solve(np.array([-0.2, 0.3]))
    again = solver.solve(np.array([1.0, -0.7]))
    assert first.certificate == again.certificate
    np.testing.assert_array_equal(first.direct.trajectory.states, again.direct.trajectory.states)


def test_a_guess_leads_to_the_same_optimum() -> None:
    problem, _, _ = two_state()
    solver = OfflineSolver(problem, EASY)
    zeta0 = np.array([1.0, -0.7])
    cold = solver.solve(zeta0)
    near = solver.solve(np.array([1.05, -0.7]))
    for guess in (near.direct.trajectory, cold.direct.trajectory):
        warm = solver.solve(zeta0, guess)
        assert warm.value == pytest.approx(cold.value, rel=1e-12)
        assert warm.faults == []
    assert warm.direct.iterations < cold.direct.iterations, "its own optimum leaves nothing to do"
