"""Sample points and the rank condition (18)."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.online import Learner, draw_samples, rank_margin

from .games import HALF_WIDTHS, Array, linear_quadratic, plain


def gram(omega: Array) -> Array:
    """Return Σ ω_j ω_j' / p_j, one sample after another."""
    total = np.zeros((omega.shape[1], omega.shape[1]))
    for row in omega:
        total += np.outer(row, row) / np.sqrt(1.0 + row @ row)
    return total


@pytest.mark.parametrize("shape", [(20, 4), (4, 4), (300, 30)])
def test_rank_margin_is_the_smallest_eigenvalue(shape: tuple[int, int]) -> None:
    omega = np.random.default_rng(0).standard_normal(shape) * 3.0
    eigenvalues = np.linalg.eigvalsh(gram(omega))
    assert rank_margin(omega) == pytest.approx(eigenvalues[0], abs=1e-12 * eigenvalues[-1])
    assert eigenvalues[0] > 0.0


@pytest.mark.parametrize("n_samples", [0, 1, 5])
def test_fewer_samples_than_weights_have_no_margin(n_samples: int) -> None:
    omega = np.random.default_rng(0).standard_normal((n_samples, 6))
    assert rank_margin(omega) == 0.0


def test_repeated_samples_have_no_margin() -> None:
    omega = np.tile(np.random.default_rng(0).standard_normal((3, 6)), (10, 1))
    assert 0.0 <= rank_margin(omega) < 1e-12


def test_margin_grows_with_samples() -> None:
    omega = np.random.default_rng(0).standard_normal((60, 5))
    margins = [rank_margin(omega[:n]) for n in range(5, 61)]
    assert np.all(np.diff(margins) >= -1e-12)
    assert margins[-1] > margins[0]


def test_rank_falls_with_actors_that_stop_acting() -> None:
    """Zero actors leave the drift alone, and the linear drift can't tell all 78 weights apart."""
    problem, basis, functions = linear_quadratic()
    exact = basis.quadratic_weights(problem.P)
    samples = draw_samples(HALF_WIDTHS, 400, seed=1)

    def margin_and_rank(start: Array) -> tuple[float, int]:
        learner = Learner(problem, basis, plain(), samples, exact, start, functions)
        residual = learner.sample_residual()
        return rank_margin(residual.omega), int(np.linalg.matrix_rank(gram(residual.omega), tol=1e-9))

    margin, rank = margin_and_rank(exact)
    assert margin > 1e-6
    assert rank == 78
    margin, rank = margin_and_rank(np.zeros(78))
    assert margin < 1e-9
    assert rank == 60


def test_samples_are_seeded() -> None:
    first = draw_samples(HALF_WIDTHS, 50, seed=4)
    np.testing.assert_array_equal(first, draw_samples(HALF_WIDTHS, 50, seed=4))
    assert not np.any(first == draw_samples(HALF_WIDTHS, 50, seed=5))
    assert first.shape == (50, 12)


@pytest.mark.parametrize("inner", [0.01, 0.1, 0.9])
def test_samples_lie_in_the_envelope_and_reach_its_edge(inner: float) -> None:
    scaled = draw_samples(HALF_WIDTHS, 4000, seed=2, inner=inner) / HALF_WIDTHS
    assert np.abs(scaled).max() <= 1.0
    assert np.all(np.abs(scaled).max(axis=0) > 0.97)
    # each is U(-1, 1) U(inner, 1), with variance E[u^2] / 3
    variance = (1.0 - inner**3) / (1.0 - inner) / 9.0
    np.testing.assert_allclose(scaled.var(axis=0), variance, rtol=0.15)
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=0.05)


def test_some_samples_are_near_the_origin() -> None:
    scaled = np.abs(draw_samples(HALF_WIDTHS, 1000, seed=3) / HALF_WIDTHS).max(axis=1)
    assert scaled.min() < 0.15
    assert scaled.max() > 0.95
    assert 0.2 < np.mean(scaled < 0.4) < 0.5


def test_no_samples() -> None:
    assert draw_samples(HALF_WIDTHS, 0, seed=1).shape == (0, 12)
