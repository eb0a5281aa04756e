"""The Legendre-Gauss-Radau rule: nodes, differentiation, integration and interpolation on (0, 1]."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import casadi
import numpy as np

from ...symbolic.arrays import Array


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


@cache
def radau_rule(degree: int) -> RadauRule:
    """Return the rule of a degree, computed once."""
    return RadauRule(degree)
