"""Exact derivatives of a transcription, from compiled derivatives of one point.

Left to itself CasADi differentiates the mapped intervals by many directional sweeps, which take four
fifths of a solve. But only the points are nonlinear: with c the differentiation matrix of the rule, the
defects Σ_l c_lj X_l - h F(X_j, w_j) have constant blocks and -h ∂F, and the Hessian of the Lagrangian

    σ Σ h b_j L + Σ μ_j'(Σ_l c_lj X_l - h F)

is block diagonal in the points apart from the constant end. Both are filled from the nonzeros of two
functions of one point, compiled once for every mesh and degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np
import scipy.sparse
from casadi import DM, MX, SX, Sparsity
from numpy.typing import NDArray

from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function, export
from ..path import RadauRule
from .stage import Stage

Indices = NDArray[np.intp]


class PointDerivatives:
    """Compiled first and second derivatives of a stage's F and L at one point."""

    def __init__(self, stage: Stage, *, compiled: bool = True) -> None:
        self.stage = stage
        self._compiled = compiled

    @cached_property
    def jacobian(self) -> tuple[casadi.Function, Sparsity]:
        """Nonzeros of ∂F/∂(ζ, w), and their sparsity."""
        return self._nonzeros("point_jacobian", casadi.jacobian(self.stage.rate, self._point), {})

    @cached_property
    def hessian(self) -> tuple[casadi.Function, Sparsity]:
        """Nonzeros of the upper triangle of σ L'' - (μ'F)'' in (ζ, w)."""
        stage = self.stage
        sigma, mu = SX.sym("sigma"), SX.sym("mu", stage.zeta.shape[0])
        total = sigma * stage.running - casadi.dot(mu, stage.rate)
        upper = casadi.triu(casadi.hessian(total, self._point)[0])
        return self._nonzeros("point_hessian", upper, {"sigma": sigma, "mu": mu})

    @property
    def _point(self) -> SX:
        return casadi.vertcat(self.stage.zeta, self.stage.w)

    def _nonzeros(self, name: str, matrix: SX, more: dict[str, SX]) -> tuple[casadi.Function, Sparsity]:
        stage = self.stage
        inputs = {"zeta": stage.zeta, "w": stage.w, "parameters": stage.parameters} | more
        function = dense_function(name, inputs, {"nonzeros": casadi.vec(matrix.nz[:])})
        kernel, _ = export(function, compiled=self._compiled)
        return kernel.function, matrix.sparsity()


@dataclass(frozen=True, eq=False)
class Assembly:
    """A sparse matrix of constants plus contributions that are added where their indices meet."""

    sparsity: Sparsity
    constant: Array
    scatter: scipy.sparse.csc_matrix

    @classmethod
    def build(
        cls,
        shape: tuple[int, int],
        constant: tuple[Indices, Indices, Array],
        varying: tuple[Indices, Indices],
    ) -> Assembly:
        """Lay out constants (rows, columns, values) and varying entries (rows, columns)."""
        rows = np.concatenate([constant[0], varying[0]])
        columns = np.concatenate([constant[1], varying[1]])
        places, which = np.unique(columns * shape[0] + rows, return_inverse=True)
        n_constant = len(constant[0])
        values = np.zeros(len(places))
        np.add.at(values, which[:n_constant], constant[2])
        n_varying = len(varying[0])
        scatter = scipy.sparse.csc_matrix(
            (np.ones(n_varying), (which[n_constant:], np.arange(n_varying))),
            shape=(len(places), n_varying),
        )
        sparsity = Sparsity.triplet(*shape, (places % shape[0]).tolist(), (places // shape[0]).tolist())
        return cls(sparsity, values, scatter)

    def fill(self, entries: MX, factor: MX | float = 1.0) -> MX:
        """Return the matrix with the constants times `factor` and the varying entries added."""
        return MX(self.sparsity, factor * DM(self.constant) + DM(self.scatter) @ entries)


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the unknowns and constraints of a transcription stand.

    Unknowns are ζ(0), the states at all points and the inputs at all points; constraints are
    ζ(0) - ζ_0 and the defects.
    """

    stage: Stage
    rule: RadauRule
    n_intervals: int

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.stage.zeta.shape[0])

    @property
    def k(self) -> int:
        """Number of inputs."""
        return int(self.stage.w.shape[0])

    @property
    def n_points(self) -> int:
        """Number of collocation points N = K d."""
        return self.n_intervals * self.rule.degree

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns n (N + 1) + k N."""
        return self.n * (self.n_points + 1) + self.k * self.n_points

    @property
    def n_constraints(self) -> int:
        """Number of constraints n (N + 1)."""
        return self.n * (self.n_points + 1)

    def unknown(self, entry: Indices) -> Indices:
        """Return the unknowns (N, entries) of entries of (ζ, w) at every point."""
        point = np.arange(self.n_points)[:, None]
        state = self.n + self.n * point + entry
        own = self.n * (self.n_points + 1) + self.k * point + entry - self.n
        return np.where(entry < self.n, state, own)

    def defect(self, row: Indices) -> Indices:
        """Return the constraints (N, rows) of rows of F at every point."""
        return self.n + self.n * np.arange(self.n_points)[:, None] + row

    def differentiation(self) -> tuple[Indices, Indices, Array]:
        """Return rows, columns and values of the constant part of the constraints' Jacobian."""
        derivative, _ = self.rule.coefficients
        d, n, state = self.rule.degree, self.n, np.arange(self.n)
        point = np.arange(self.n_points)
        first = point - point % d  # number of states before an interval is that of its start
        rows, columns, values = [state], [state], [np.ones(n)]
        for node in range(d + 1):
            source = first + node
            rows.append((n + n * point[:, None] + state).ravel())
            columns.append((n * source[:, None] + state).ravel())
            values.append(np.repeat(derivative[node, point % d], n))
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def exact_derivatives(
    layout: Layout, derivatives: PointDerivatives, program: dict[str, MX]
) -> dict[str, casadi.Function]:
    """Return the options `jac_g` and `hess_lag` of `casadi.nlpsol` for the program of a layout."""
    unknowns, arguments = program["x"], program["p"]
    n, k, N, d = layout.n, layout.k, layout.n_points, layout.rule.degree
    x, p = MX.sym("x", unknowns.shape[0]), MX.sym("p", arguments.shape[0])
    states = casadi.reshape(x[n : n * (N + 1)], n, N)
    inputs = casadi.reshape(x[n * (N + 1) :], k, N)
    q = int(layout.stage.parameters.shape[0])
    lengths = p[n : n + layout.n_intervals]
    given = casadi.reshape(p[n + layout.n_intervals : n + layout.n_intervals + q * N], q, N)
    h = casadi.vec(casadi.repmat(lengths.T, d, 1)).T
    weights = h * DM(np.tile(layout.rule.coefficients[1], layout.n_intervals)).T
    at_points = (states, inputs, given)
    constraints = casadi.Function("constraints", [unknowns, arguments], [program["g"]])(x, p)
    jacobian = _jacobian(layout, derivatives, at_points, h)
    sigma, multipliers = MX.sym("sigma"), MX.sym("lambda", layout.n_constraints)
    hessian = _hessian(layout, derivatives, at_points, h, weights, sigma, multipliers)
    return {
        "jac_g": casadi.Function(
            "nlp_jac_g", [x, p], [constraints, jacobian], ["x", "p"], ["g", "jac:g:x"]
        ),
        "hess_lag": casadi.Function(
            "nlp_hess_l",
            [x, p, sigma, multipliers],
            [hessian],
            ["x", "p", "lam:f", "lam:g"],
            ["triu:hess:gamma:x:x"],
        ),
    }


def _jacobian(layout: Layout, derivatives: PointDerivatives, at_points: tuple[MX, ...], h: MX) -> MX:
    function, sparsity = derivatives.jacobian
    rows, columns = (np.array(index, dtype=np.intp) for index in sparsity.get_triplet())
    varying = layout.defect(rows).ravel(), layout.unknown(columns).ravel()
    shape = layout.n_constraints, layout.n_unknowns
    assembly = Assembly.build(shape, layout.differentiation(), varying)
    entries = function.map(layout.n_points)(*at_points) * casadi.repmat(-h, len(rows), 1)
    return assembly.fill(casadi.vec(entries))


def _hessian(
    layout: Layout,
    derivatives: PointDerivatives,
    at_points: tuple[MX, ...],
    h: MX,
    weights: MX,
    sigma: MX,
    multipliers: MX,
) -> MX:
    n, N = layout.n, layout.n_points
    function, sparsity = derivatives.hessian
    rows, columns = (np.array(index, dtype=np.intp) for index in sparsity.get_triplet())
    upper = np.triu_indices(n)
    constant = (n * N + upper[0], n * N + upper[1], 2.0 * layout.stage.terminal[upper])
    varying = layout.unknown(rows).ravel(), layout.unknown(columns).ravel()
    assembly = Assembly.build((layout.n_unknowns, layout.n_unknowns), constant, varying)
    mu = casadi.reshape(multipliers[n:], n, N) * casadi.repmat(h, n, 1)
    entries = function.map(N)(*at_points, sigma * weights, mu)
    return assembly.fill(casadi.vec(entries), sigma)
