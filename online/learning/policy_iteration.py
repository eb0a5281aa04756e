"""Batch policy iteration: the limit that the online laws should approach.

Both actors hold the weights W_k. Rows (ω_i, r_i, w_i) under their policy are fitted to the end,

    W_{k+1} = argmin_W Σ w_i (r_i + ω_i'W)^2 + leash Σ_l (Σ_i w_i ω_il^2) (W_l - W_ref,l)^2,

and both actors go all the way there. On a linear-quadratic game with the monomials as basis it is
Kleinman's iteration (1968, IEEE Trans. Automatic Control 13): with A_k = A - B R_eff^-1 B'P_k,

    A_k'P_{k+1} + P_{k+1} A_k + Q + P_k B R_eff^-1 B'P_k = 0.

The critic laws (`critic`) do the same little by little: at rest, with rows that stay, their fixed
points are those of this iteration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...symbolic import Game, RunError
from ...symbolic.arrays import Array
from ..paper import BellmanTerms, bellman_error
from ..rows import PathRows

Rows = tuple[Array, Array, Array]  # ω (N, m), r (N,), w (N,)
RowsUnder = Callable[[Array], Rows | None]


@dataclass(frozen=True)
class PolicyIteration:
    """The iterates.

    Attributes
    ----------
    weights : (K + 1, m) W_0 ... W_K
    converged : whether the last step was within the tolerance
    """

    weights: Array
    converged: bool


def bellman_rows(
    terms: BellmanTerms, game: Game, row_weights: Callable[[Array, Array], Array]
) -> RowsUnder:
    """Return the rows of the Bellman error (17) at fixed points, as a function of the weights.

    `row_weights`: w from ω (N, m) and ζ'Qζ (N,).
    """

    def under(weights: Array) -> Rows:
        found = bellman_error(terms, game, weights, weights, weights)
        return found.omega, found.local_cost, row_weights(found.omega, terms.state_cost)

    return under


def costate_rows(path_rows: PathRows, starts: Array) -> RowsUnder:
    """Return the rows of the costate error along the paths from `starts` (N, n), likewise."""

    def under(weights: Array) -> Rows | None:
        rows = path_rows.at(starts, weights, weights)
        return None if rows is None else (rows[0], -rows[1], rows[2])

    return under


def fitted(rows: Rows, leash: float = 0.0, reference: Array | None = None) -> Array:
    """Return the weights that minimise the weighted squares of the rows and the leash, (m,).

    Without a leash, weights that the rows do not determine are the smallest (in columns scaled to
    norm 1). `reference`: (m,) what the leash pulls to, 0 if None.
    """
    omega, cost, weights = rows
    root = np.sqrt(weights)
    design, target = omega * root[:, None], -root * cost
    size = np.linalg.norm(design, axis=0)
    size[size == 0.0] = 1.0
    pull = np.sqrt(leash) * np.eye(len(size))
    center = np.zeros(len(size)) if reference is None else reference
    # in scaled columns the leash is the same for all weights
    stacked = np.vstack([design / size, pull])
    solution, *_ = np.linalg.lstsq(stacked, np.append(target, pull @ (size * center)), rcond=None)
    return np.asarray(solution / size)


def policy_iteration(
    rows_under: RowsUnder,
    start: Array,
    *,
    leash: float = 0.0,
    reference: Array | None = None,
    tolerance: float = 1e-10,
    most: int = 50,
) -> PolicyIteration:
    """Return the iterates from W_0 = `start` (m,), until a step is below the tolerance.

    Parameters
    ----------
    rows_under : the rows under the policy of weights (m,), None where it gives none
    leash, reference : of every fit
    tolerance : of |W_{k+1} - W_k|, relative to |W_{k+1}|
    most : iterations

    Raises
    ------
    RunError
        If there are no rows, or rows that are not finite: the policy is not admissible.
    """
    iterates = [np.asarray(start, dtype=float)]
    for k in range(most):
        rows = rows_under(iterates[-1])
        if rows is None or not all(np.all(np.isfinite(part)) for part in rows):
            raise RunError(
                f"policy iteration has no rows after {k} steps: the policy loses the vehicle; start "
                "from weights whose policy is stable"
            )
        iterates.append(fitted(rows, leash, reference))
        step = float(np.linalg.norm(iterates[-1] - iterates[-2]))
        if step <= tolerance * float(np.linalg.norm(iterates[-1])):
            return PolicyIteration(np.array(iterates), converged=True)
    return PolicyIteration(np.array(iterates), converged=False)
