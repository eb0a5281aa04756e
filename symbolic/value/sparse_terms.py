"""What (17) needs of a point, without its zeros: the nonzeros of σ', f, the nonzeros of g, and ζ'Qζ.

Most functions of a basis depend on a few states only, so that σ' is sparse (144 of 936 entries for the
78 monomials in 12 states), and so is g.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX

from ..arrays import Index
from ..compiled import dense_function
from ..game import Problem
from .basis import Basis

UNROLLED = 4  # entries of a column of σ' come in multiples of it, filled with zeros


@dataclass(frozen=True)
class TermLayout:
    """Where the entries of a point's terms are: σ' by columns, f, g by columns, ζ'Qζ.

    Attributes
    ----------
    column : (n + 1,) where the columns of σ' start
    row : of each entry of σ'
    input : (k + 1,) where the columns of g start
    state : row of each entry of g
    """

    column: Index
    row: Index
    input: Index
    state: Index

    @property
    def n_entries(self) -> int:
        """Number of entries of a point."""
        return len(self.row) + len(self.column) - 1 + len(self.state) + 1


def sparse_terms(problem: Problem, basis: Basis) -> tuple[casadi.Function, TermLayout]:
    """Return the terms as a function of ζ with one column of results, and their layout."""
    jacobian = casadi.jacobian(basis.sigma, basis.zeta)
    g = casadi.sparsify(problem.input_matrix)
    entries: list[SX] = []
    row: list[int] = []
    column = [0]
    for i in range(basis.n):
        rows = [r for r in range(basis.n_basis) if jacobian.has_nz(r, i)]
        fill = -len(rows) % UNROLLED
        entries += [jacobian[r, i] for r in rows] + [SX(0)] * fill
        row += rows + [0] * fill
        column.append(len(row))
    state_cost = casadi.bilin(DM(problem.game.Q), problem.zeta, problem.zeta)
    columns = np.repeat(np.arange(g.shape[1]), np.diff(g.colind()))
    inputs = [g[int(i), int(j)] for i, j in zip(g.row(), columns, strict=True)]
    terms = casadi.vertcat(*entries, problem.drift, *inputs, state_cost)
    function = dense_function("sparse_terms", {"zeta": problem.zeta}, {"terms": terms})
    indices = (np.array(x, dtype=np.int64) for x in (column, row, g.colind(), g.row()))
    return function, TermLayout(*indices)
