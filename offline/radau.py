"""The Legendre-Gauss-Radau rule: nodes, differentiation, integration and interpolation on (0, 1]."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import casadi
import numpy as np

from ..symbolic.vehicle import Array


@dataclass(frozen=True)
class RadauRule:
    """Degree-d Radau rule on (0, 1].

    Attributes
    ----------
    degree : d; the last of the d nodes is 1
    """

    degree: int

    @cached_property
    def nodes(self) -> Array:
        """Collocation points, shape (d,)."""
        return np.array(casadi.collocation_points(self.degree, "radau"))

    @cached_property
    def coefficients(self) -> tuple[Array, Array]:
        """Derivative (d + 1, d) of the Lagrange polynomials of 0 and the nodes, and weights (d,)."""
        derivative = np.array(casadi.collocation_coeff(list(self.nodes))[0])
        # the weights are the integrals up to 1; CasADi's own are wrong for one point
        return derivative, np.asarray(np.linalg.inv(derivative[1:])[:, -1], dtype=np.float64)

    @cached_property
    def integration(self) -> Array:
        """A (d, d) of the Radau IIA method: integrals from 0 to each node, rows, of the polynomials
        that are 1 at one node.
        """
        derivative, _ = self.coefficients
        return np.asarray(np.linalg.inv(derivative[1:]).T, dtype=np.float64)

    @cached_property
    def _with_start(self) -> tuple[Array, Array]:
        points = np.append(0.0, self.nodes)
        return points, _barycentric_weights(points)

    @cached_property
    def _without_start(self) -> tuple[Array, Array]:
        return self.nodes, _barycentric_weights(self.nodes)

    def interpolation(self, tau: Array, *, start: bool) -> Array:
        """Return the Lagrange polynomials of the nodes at `tau`, (len(tau), d), or d + 1 with 0."""
        points, weights = self._with_start if start else self._without_start
        gaps = tau[:, None] - points
        exact = gaps == 0.0
        terms = weights / np.where(exact, 1.0, gaps)
        rows = terms / terms.sum(axis=1, keepdims=True)
        hit = exact.any(axis=1)
        rows[hit] = exact[hit]
        return np.asarray(rows)


@cache
def radau_rule(degree: int) -> RadauRule:
    """Return the rule of a degree, computed once."""
    return RadauRule(degree)


def _barycentric_weights(points: Array) -> Array:
    gaps = points[:, None] - points
    np.fill_diagonal(gaps, 1.0)
    return np.asarray(1.0 / gaps.prod(axis=1))
