"""Gauss-Legendre collocation: the rule of the boundary value problem, and polynomials on its nodes.

The d Gauss points of an interval are inside it; the polynomial through them and the interval's start
gives the end. The rule is of order 2d at the mesh points, symmetric in time, which suits a system with
as many growing as decaying modes, and symplectic (Ascher, Mattheij and Russell 1995, ch. 5).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from ...symbolic.arrays import Array


@dataclass(frozen=True, eq=False)
class GaussRule:
    """Degree-d Gauss rule on (0, 1).

    Attributes
    ----------
    degree : d, number of nodes
    """

    degree: int

    @cached_property
    def nodes(self) -> Array:
        """Collocation points, shape (d,)."""
        return np.asarray(0.5 * (legendre.leggauss(self.degree)[0] + 1.0))

    @cached_property
    def weights(self) -> Array:
        """Quadrature weights, shape (d,); exact for polynomials of degree 2d - 1."""
        return np.asarray(0.5 * legendre.leggauss(self.degree)[1])

    @cached_property
    def points(self) -> Array:
        """The start and the nodes, shape (d + 1,): what the polynomial of a state goes through."""
        return np.append(0.0, self.nodes)

    @cached_property
    def derivative(self) -> Array:
        """Derivatives at the nodes of the Lagrange polynomials of `points`, shape (d, d + 1)."""
        slopes = legendre.legder(np.eye(self.degree + 1), scl=2.0)
        at_nodes = legendre.legval(2.0 * self.nodes - 1.0, slopes).T
        return np.asarray(at_nodes @ _coefficients(self.points))

    @cached_property
    def end(self) -> Array:
        """Values at 1 of the Lagrange polynomials of `points`, shape (d + 1,)."""
        return np.asarray(np.ones(self.degree + 1) @ _coefficients(self.points))

    def times(self, mesh: Array) -> Array:
        """Return the nodes on every interval of a mesh, shape (K, d) [s]."""
        return np.asarray(mesh[:-1, None] + np.diff(mesh)[:, None] * self.nodes)


def _coefficients(points: Array) -> Array:
    """Return the matrix from values at points of (0, 1) to Legendre coefficients."""
    return np.asarray(np.linalg.inv(legendre.legvander(2.0 * points - 1.0, len(points) - 1)))
