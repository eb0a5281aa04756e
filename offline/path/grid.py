"""Stages of the structured Newton method: maps from stage unknowns to points, and Riccati passes.

A stage is one mesh interval. Its unknowns are y = (η_i, η_dot_i, a_i1 ... a_id), its end is F y, and
its second-order cost model is g'y + 1/2 y'H y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.linalg import lapack

from ...symbolic.arrays import Array
from .radau import RadauRule, radau_rule


class Grid:
    """A mesh and a degree, and the linear maps from stage unknowns (ζ_i, a_i1 ... a_id) to points."""

    def __init__(self, mesh: Array, degree: int, n_inputs: int) -> None:
        self.mesh, self.degree, self.k = mesh, degree, n_inputs
        self.K = len(mesh) - 1
        rule, h = radau_rule(degree), np.diff(mesh)
        self.weights = h[:, None] * rule.coefficients[1]
        self.to_points = _to_points(rule, h)
        # rows (α, β) of stage unknowns, columns (j, r, s) of point derivatives
        pairs = np.einsum("ij,ijra,ijsb->iabjrs", self.weights, self.to_points, self.to_points)
        self.pairs = np.ascontiguousarray(pairs.reshape(self.K, (2 + degree) ** 2, 9 * degree))
        ends = self.to_points[:, -1, :2]
        self.flow = np.einsum("ira,pq->irpaq", ends, np.eye(n_inputs)).reshape(
            self.K, 2 * n_inputs, (2 + degree) * n_inputs
        )

    @property
    def times(self) -> Array:
        """Collocation times, shape (K d,) [s]."""
        nodes = radau_rule(self.degree).nodes
        return np.asarray((self.mesh[:-1, None] + np.diff(self.mesh)[:, None] * nodes).ravel())

    def trajectory(self, zeta0: Array, accelerations: Array) -> Array:
        """Return the states at 0 and the collocation points, (K d + 1, 2 k)."""
        points = self.points(self.stages(zeta0, accelerations))
        return np.vstack([zeta0, points[:, : 2 * self.k]])

    def points(self, stages: Array) -> Array:
        """Return (η, η_dot, a) at the collocation points, (K d, 3 k), from stage unknowns."""
        return np.asarray((self.to_points @ stages[:, None]).reshape(-1, 3 * self.k))

    def stages(self, zeta0: Array, accelerations: Array) -> Array:
        """Return the stage unknowns, (K, 2 + d, k), of a trajectory from ζ_0."""
        stages = np.empty((self.K, 2 + self.degree, self.k))
        stages[:, 2:] = accelerations
        state = zeta0.reshape(2, self.k)
        for i in range(self.K):
            stages[i, :2] = state
            state = self.to_points[i, -1, :2] @ stages[i]
        return stages

    def condense_gradient(self, gradient: Array) -> Array:
        """Return stage gradients (K, (2 + d) k) from point gradients (K d, 3 k)."""
        weighted = self.weights[..., None, None] * gradient.reshape(self.K, self.degree, 3, self.k)
        by_stage = np.einsum("ijra,ijrp->iap", self.to_points, weighted)
        return np.asarray(by_stage.reshape(self.K, -1))

    def condense(self, hessian: Array) -> Array:
        """Return stage Hessians (K, (2 + d) k, (2 + d) k) from point Hessians (K d, 9 k^2)."""
        K, d, k = self.K, self.degree, self.k
        blocks = hessian.reshape(K, d, 3, k, 3, k).transpose(0, 1, 2, 4, 3, 5).reshape(K, 9 * d, k * k)
        stage = (self.pairs @ blocks).reshape(K, 2 + d, 2 + d, k, k)
        return np.asarray(stage.transpose(0, 1, 3, 2, 4).reshape(K, (2 + d) * k, (2 + d) * k))


def _to_points(rule: RadauRule, h: Array) -> Array:
    """C (K, d, 3, 2 + d): η, η_dot and a at the points from η_0, η_dot_0 and a_1 ... a_d."""
    d, A = rule.degree, rule.integration
    C = np.zeros((len(h), d, 3, 2 + d))
    C[:, :, 0, 0] = 1.0
    C[:, :, 0, 1] = h[:, None] * rule.nodes
    C[:, :, 0, 2:] = h[:, None, None] ** 2 * (A @ A)
    C[:, :, 1, 1] = 1.0
    C[:, :, 1, 2:] = h[:, None, None] * A
    C[:, :, 2, 2:] = np.eye(d)
    return C


Gains = list[tuple[Array, Array]]


@dataclass(frozen=True)
class RiccatiPass:
    """A backward pass through stages that are all convex.

    Attributes
    ----------
    P, p : (n, n) and (n,) of the cost to go p'x + 1/2 x'P x of the first stage
    promised : by how much the model falls along the step
    gains : of each stage, the step of its accelerations as K x + k
    """

    P: Array
    p: Array
    promised: float
    gains: Gains

    def forward(self, grid: Grid) -> Array:
        """Return the minimising step of the accelerations, (K, d, k)."""
        return _forward(grid, self.gains, 0, np.zeros(2 * grid.k))


@dataclass(frozen=True)
class ConjugatePoint:
    """A backward pass that met a stage that is not convex: a conjugate point.

    Attributes
    ----------
    stage : its number
    direction : (d k,) of the most negative curvature relative to the inertia
    gains : of the stages after it
    """

    stage: int
    direction: Array
    gains: Gains

    def curvature(self, grid: Grid) -> Array:
        """Return accelerations (K, d, k) along which the second variation is not positive.

        Nothing before the stage, its direction in it, and the optimal answer after it.
        """
        state = grid.flow[self.stage] @ np.concatenate([np.zeros(2 * grid.k), self.direction])
        answer = [(gain, np.zeros_like(constant)) for gain, constant in self.gains]
        curve = np.zeros((grid.K, grid.degree, grid.k))
        curve[self.stage] = self.direction.reshape(grid.degree, grid.k)
        curve[self.stage + 1 :] = _forward(grid, answer, self.stage + 1, state)
        return curve


def backward(
    grid: Grid, hessian: Array, gradient: Array, P: Array, p: Array, inertia: Array
) -> RiccatiPass | ConjugatePoint:
    """Riccati recursion over the stages, from the cost to go p'x + 1/2 x'P x of the end.

    Parameters
    ----------
    hessian, gradient : (K, (2 + d) k, (2 + d) k) and (K, (2 + d) k) of the stages
    inertia : (k, k) of the accelerations at a point, positive definite, what a negative curvature is
        measured against
    """
    n = 2 * grid.k
    gains: Gains = []
    promised = 0.0
    for i in range(grid.K - 1, -1, -1):
        F = grid.flow[i]
        H = hessian[i] + F.T @ P @ F
        g = gradient[i] + F.T @ p
        factor, failed = lapack.dpotrf(H[n:, n:], lower=1)
        if failed:
            _, vectors = scipy.linalg.eigh(H[n:, n:], np.kron(np.diag(grid.weights[i]), inertia))
            return ConjugatePoint(i, vectors[:, 0], gains[::-1])
        right = np.column_stack([H[n:, :n], g[n:]])
        half, _ = lapack.dtrtrs(factor, right, lower=1)
        answer, _ = lapack.dtrtrs(factor, half, lower=1, trans=1)
        P = H[:n, :n] - half[:, :n].T @ half[:, :n]
        p = g[:n] - half[:, :n].T @ half[:, n]
        promised += 0.5 * float(half[:, n] @ half[:, n])
        gains.append((-answer[:, :n], -answer[:, n]))
    return RiccatiPass(P, p, promised, gains[::-1])


def adjoint(grid: Grid, gradient: Array, p: Array) -> Array:
    """Return the gradient of the cost in ζ_0 at fixed accelerations, (n,)."""
    n = 2 * grid.k
    for i in range(grid.K - 1, -1, -1):
        p = gradient[i, :n] + grid.flow[i, :, :n].T @ p
    return p


def _forward(grid: Grid, gains: Gains, first: int, state: Array) -> Array:
    step = np.empty((len(gains), grid.degree * grid.k))
    for i, (gain, constant) in enumerate(gains):
        step[i] = gain @ state + constant
        state = grid.flow[first + i] @ np.concatenate([state, step[i]])
    return step.reshape(-1, grid.degree, grid.k)
