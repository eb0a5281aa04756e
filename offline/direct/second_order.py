"""Second-order sufficiency of a collocated optimum, by backward induction over the intervals.

On interval i the linearised defects give δX = Φ δs + Γ δw from its start s, and the Hessian of the
Lagrangian a quadratic form in (δX, δw). With the cost to go ½ δs'Π δs of what follows,

    M_i = [Γ; I]'(W_i + Π_{i+1}) [Γ; I],     Π_i = M_ss - M_sw M_i^-1 M_ws.

The reduced Hessian is positive definite, and the point a strict local minimum, if and only if every
M_i is: these are its Schur complements. It is the discrete form of the absence of conjugate points on
(0, T] (Jacobi; Bryson and Ho 1975, ch. 6), at the cost of one small factorisation an interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from .transcription import Optimum, Transcription


@dataclass(frozen=True)
class SecondOrder:
    """Whether a stationary point is a strict local minimum.

    Attributes
    ----------
    margin : smallest eigenvalue of the M_i relative to the input's own curvature h_i b_j ∂²L/∂w²;
        1 or more where the states add no negative curvature, 0 at a conjugate point
    conjugate : start of the last interval on which M_i is not positive [s], or None
    """

    margin: float
    conjugate: float | None

    @property
    def holds(self) -> bool:
        """Whether the sufficient condition holds."""
        return self.conjugate is None


def second_order(program: Transcription, optimum: Optimum) -> SecondOrder:
    """Return the verdict on what `program` converged to."""
    n, k = int(program.stage.zeta.shape[0]), int(program.stage.w.shape[0])
    d, first_input = program.rule.degree, n * (program.n_points + 1)
    hessian, jacobian = (part.tocsr() for part in program.curvature(optimum))
    to_go, margin = np.zeros((n, n)), np.inf
    for i in range(program.n_intervals - 1, -1, -1):
        start = np.arange(n) + i * n * d
        states = np.arange(n * d) + n * (i * d + 1)
        inputs = first_input + np.arange(k * d) + i * k * d
        rows = jacobian[states]  # the defects follow the n rows of ζ(0) - ζ_0, as the states do
        solved = np.linalg.solve(
            rows[:, states].toarray(), -rows[:, np.append(start, inputs)].toarray()
        )
        own = hessian[inputs][:, inputs].toarray()
        # columns: δs, then δw; rows: δX, then δw
        lifted = np.vstack([solved, np.eye(k * d, n + k * d, n)])
        both = np.append(states, inputs)
        block = hessian[both][:, both].toarray()
        block[n * (d - 1) : n * d, n * (d - 1) : n * d] += to_go
        M = lifted.T @ block @ lifted
        smallest = float(scipy.linalg.eigh(M[n:, n:], own, eigvals_only=True)[0])
        margin = min(margin, smallest)
        if smallest <= 0.0:
            return SecondOrder(margin, float(optimum.path.mesh[i]))
        to_go = M[:n, :n] - M[:n, n:] @ np.linalg.solve(M[n:, n:], M[n:, :n])
        to_go = 0.5 * (to_go + to_go.T)
    return SecondOrder(margin, None)
