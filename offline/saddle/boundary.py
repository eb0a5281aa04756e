"""The boundary value problem of the saddle point on a mesh, and Newton's step for it.

    ζ_dot = f + g (u_1 + u_2),   λ_dot = -∂H/∂ζ,   ∂H/∂u_1 = 0,   ∂H/∂u_2 / γ^2 = 0,
    ζ(0) = ζ_0,   λ(T) = 2 P ζ(T), the stable manifold of the linearised game,

with H = ζ'Qζ + u_1'R u_1 - γ^2 u_2'W_d u_2 + λ'(f + g (u_1 + u_2)) of (6). Unknowns are ζ and λ at the
mesh points and ζ, λ, u_1 and u_2 at the Gauss points. The Newton matrix is almost block diagonal
and factored as such: the players are eliminated at each point, the points on each interval, and the
mesh points by one sweep back, which carries the gradient of λ_i in ζ_i, and one forward (Ascher,
Mattheij and Russell 1995, ch. 7; the sweep is the discrete Riccati equation, so it does not grow).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...symbolic import Problem
from ...symbolic.arrays import Array
from ..path import GaussRule
from .extremal_field import ExtremalField, FieldTerms


@dataclass(frozen=True)
class Unknowns:
    """Unknowns of the boundary value problem, or a Newton step of them.

    Attributes
    ----------
    ends : (K + 1, 2n) ζ and λ at the mesh points
    points : (K, d, 2n) ζ and λ at the Gauss points
    control, disturbance : (K, d, k) u_1 and u_2 there
    """

    ends: Array
    points: Array
    control: Array
    disturbance: Array

    def plus(self, step: Unknowns) -> Unknowns:
        """Return the unknowns after a step."""
        return Unknowns(
            self.ends + step.ends,
            self.points + step.points,
            self.control + step.control,
            self.disturbance + step.disturbance,
        )


@dataclass(frozen=True)
class _Condensed:
    """One Newton system without its players: δu_i = own_i + gain_i (push_y δy), at every point.

    jacobian (K, d, 2n, 2n) and flow (K, d, 2n) of (ζ, λ)_dot with both players eliminated.
    """

    jacobian: Array
    flow: Array
    push_y: Array
    own: tuple[Array, Array]
    gain: tuple[Array, Array]


class BoundaryProblem:
    """Pontryagin's equations of a game, collocated by a Gauss rule.

    Parameters
    ----------
    problem : the game on its plant; γ may be infinite
    field : the field of this plant
    rule : of the collocation
    """

    def __init__(self, problem: Problem, field: ExtremalField, rule: GaussRule) -> None:
        self.problem = problem
        self.field = field
        self.rule = rule

    def at_rest(self, n_intervals: int) -> Unknowns:
        """Return zeros; from there the first Newton step is the linearised game's trajectory."""
        n, k, d = self.problem.n_states, self.problem.n_inputs, self.rule.degree
        return Unknowns(
            np.zeros((n_intervals + 1, 2 * n)),
            np.zeros((n_intervals, d, 2 * n)),
            np.zeros((n_intervals, d, k)),
            np.zeros((n_intervals, d, k)),
        )

    def size(self, unknowns: Unknowns) -> float:
        """Return the largest state or costate at the mesh points, in half-widths of the envelope."""
        return float(np.abs(unknowns.ends / self._units).max())

    def newton_step(self, unknowns: Unknowns, zeta0: Array, lengths: Array) -> Unknowns:
        """Return Newton's step from `unknowns` on intervals of given lengths (K,).

        Raises
        ------
        numpy.linalg.LinAlgError
            If the system is singular.
        """
        n = self.problem.n_states
        y, control, disturbance = unknowns.points, unknowns.control, unknowns.disturbance
        terms = self.field(y[..., :n], y[..., n:], control + disturbance)
        condensed = self._without_players(terms, unknowns)
        inner = self._without_points(condensed, unknowns, lengths)
        ends = self._sweep(self._transfer(inner, unknowns), unknowns.ends, zeta0)
        points = inner[..., -1] + np.einsum("kdab,kb->kda", inner[..., :-1], ends[:-1])
        push = np.einsum("kdab,kdb->kda", condensed.push_y, points)
        players = (own + push @ gain.T for own, gain in zip(condensed.own, condensed.gain, strict=True))
        return Unknowns(ends, points, *players)

    @cached_property
    def _units(self) -> Array:
        """Half-widths of the states, and of the costates where λ = 2 P ζ, shape (2n,)."""
        scale = self.problem.scale
        return np.concatenate([scale, 2.0 * np.abs(self.problem.P) @ scale])

    def _without_players(self, terms: FieldTerms, unknowns: Unknowns) -> _Condensed:
        """Eliminate δu_1 and δu_2, whose stationarity has the blocks 2R and -2 W_d."""
        game, n = self.problem.game, self.problem.n_states
        zeta, control, disturbance = unknowns.points[..., :n], unknowns.control, unknowns.disturbance
        halves = 0.5 * game.R_inverse, np.asarray(0.5 * np.linalg.inv(game.W_d), dtype=np.float64)
        weaker = float(game.gamma) ** -2
        stationarity_1 = 2.0 * control @ game.R + terms.push
        stationarity_2 = weaker * terms.push - 2.0 * disturbance @ game.W_d
        own = -stationarity_1 @ halves[0], stationarity_2 @ halves[1]
        gain = -halves[0], weaker * halves[1]
        push_y = np.concatenate([terms.push_zeta, np.swapaxes(terms.g, -1, -2)], axis=-1)
        flow_u = np.concatenate([terms.g, -np.swapaxes(terms.push_zeta, -1, -2)], axis=-2)
        jacobian = flow_u @ ((gain[0] + gain[1]) @ push_y)
        jacobian[..., :n, :n] += terms.rate_zeta
        jacobian[..., n:, :n] -= terms.pull_zeta + 2.0 * game.Q
        jacobian[..., n:, n:] -= np.swapaxes(terms.rate_zeta, -1, -2)
        flow = np.concatenate([terms.rate, -terms.pull - 2.0 * zeta @ game.Q], axis=-1)
        flow = flow + np.einsum("kdau,kdu->kda", flow_u, own[0] + own[1])
        return _Condensed(jacobian, flow, push_y, own, gain)

    def _without_points(self, condensed: _Condensed, unknowns: Unknowns, lengths: Array) -> Array:
        """Return δy at the points as an affine function of δy at the start, (K, d, 2n, 2n + 1)."""
        K, d, m = condensed.flow.shape
        start, inner = self.rule.derivative[:, 0], self.rule.derivative[:, 1:]
        slopes = np.einsum("j,ka->kja", start, unknowns.ends[:-1])
        slopes += np.einsum("jl,kla->kja", inner, unknowns.points)
        matrix = np.zeros((K, d, m, d, m))
        for a in range(m):
            matrix[:, :, a, :, a] = inner
        for j in range(d):
            matrix[:, j, :, j, :] -= lengths[:, None, None] * condensed.jacobian[:, j]
        right = np.empty((K, d, m, m + 1))
        right[..., :m] = -start[:, None, None] * np.eye(m)
        right[..., m] = lengths[:, None, None] * condensed.flow - slopes
        solved = np.linalg.solve(matrix.reshape(K, d * m, d * m), right.reshape(K, d * m, m + 1))
        return np.asarray(solved.reshape(K, d, m, m + 1))

    def _transfer(self, inner: Array, unknowns: Unknowns) -> Array:
        """Return δy at the interval's end as an affine function of δy at its start, (K, 2n, 2n + 1)."""
        first, rest = self.rule.end[0], self.rule.end[1:]
        transfer = np.einsum("d,kdab->kab", rest, inner)
        transfer[..., :-1] += first * np.eye(transfer.shape[1])
        reached = first * unknowns.ends[:-1] + np.einsum("d,kda->ka", rest, unknowns.points)
        transfer[..., -1] += reached - unknowns.ends[1:]
        return np.asarray(transfer)

    def _sweep(self, transfer: Array, ends: Array, zeta0: Array) -> Array:
        """Return δy at the mesh points, (K + 1, 2n): δλ_i = G_i δζ_i + c_i back, δζ_i forward."""
        n = self.problem.n_states
        gradient = 2.0 * self.problem.P
        offset = gradient @ ends[-1, :n] - ends[-1, n:]
        laws = [np.column_stack([gradient, offset])]
        for block in transfer[::-1]:
            upper, lower = block[:n], block[n:]
            matrix = lower[:, n:-1] - gradient @ upper[:, n:-1]
            right = gradient @ upper - lower
            right[:, -1] += offset
            law = np.linalg.solve(matrix, np.delete(right, np.s_[n : 2 * n], axis=1))
            gradient, offset = law[:, :n], law[:, n]
            laws.append(law)
        steps = np.empty_like(ends)
        steps[0, :n] = zeta0 - ends[0, :n]
        for i, law in enumerate(reversed(laws)):
            steps[i, n:] = law[:, :n] @ steps[i, :n] + law[:, n]
            if i < len(transfer):
                steps[i + 1, :n] = transfer[i, :n, :-1] @ steps[i] + transfer[i, :n, -1]
        return steps
