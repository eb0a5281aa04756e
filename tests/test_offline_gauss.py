"""Gauss collocation: the rule itself, and polynomials on its nodes."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.offline.path import GaussRule, interpolate

DEGREES = range(1, 10)


@pytest.mark.parametrize("degree", DEGREES)
def test_quadrature_is_exact_to_its_degree(degree: int) -> None:
    """d Gauss points integrate polynomials of degree 2d - 1 exactly, and not of degree 2d."""
    rule = GaussRule(degree)
    for power in range(2 * degree):
        assert rule.weights @ rule.nodes**power == pytest.approx(1.0 / (power + 1), abs=1e-14)
    assert abs(rule.weights @ rule.nodes ** (2 * degree) - 1.0 / (2 * degree + 1)) > 1e-13


@pytest.mark.parametrize("degree", DEGREES)
def test_derivative_and_end_are_exact_to_its_degree(degree: int) -> None:
    rule = GaussRule(degree)
    for power in range(degree + 1):
        slopes = power * rule.nodes ** max(power - 1, 0)
        np.testing.assert_allclose(rule.derivative @ rule.points**power, slopes, atol=1e-11)
        assert rule.end @ rule.points**power == pytest.approx(1.0, abs=1e-12)


def test_interpolation_keeps_polynomials_of_its_degree() -> None:
    """A cubic on four points of every interval, and a kink only where the mesh has a point."""
    rule, mesh = GaussRule(3), np.array([0.0, 0.5, 2.0, 3.0])
    inside = mesh[:-1, None] + np.diff(mesh)[:, None] * rule.points
    times = np.linspace(0.0, 3.0, 61)
    for function in (lambda t: t**3 - 2.0 * t, lambda t: np.abs(t - 2.0) ** 3):
        values = np.stack([function(inside), -function(inside)], axis=-1)
        sampled = interpolate(rule.points, mesh, values, times)
        np.testing.assert_allclose(sampled[:, 0], function(times), atol=1e-13)
        np.testing.assert_allclose(sampled[:, 1], -function(times), atol=1e-13)


def test_interpolation_of_straight_lines_between_their_ends() -> None:
    """At a point itself the barycentric sum of the others may vanish."""
    mesh, ends = np.array([0.0, 1.0, 3.0]), np.array([[[0.0], [1.0]], [[1.0], [5.0]]])
    times = np.array([0.0, 0.5, 1.0, 2.0, 3.0])
    found = interpolate(np.array([0.0, 1.0]), mesh, ends, times)
    np.testing.assert_allclose(found[:, 0], [0.0, 0.5, 1.0, 3.0, 5.0], rtol=1e-15)
