"""A collocated trajectory, and its polynomials between the collocation points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from ...symbolic import Game
from ...symbolic.arrays import Array
from .interpolation import barycentric_weights, interpolate
from .radau import RadauRule, radau_rule


@dataclass(frozen=True)
class Trajectory:
    """A collocated optimal trajectory.

    Attributes
    ----------
    mesh : (K + 1,) interval ends [s]
    times : (K d + 1,) [s]; ζ(0) first, then the collocation points
    states : (K d + 1, n)
    v : (K d, k) single-player input at the collocation points
    degree : d
    """

    mesh: Array
    times: Array
    states: Array
    v: Array
    degree: int

    def players(self, game: Game) -> tuple[Array, Array]:
        """Return u_1* and u_2* at the collocation points, each (K d, k)."""
        return game.players(self.v)

    @property
    def rule(self) -> RadauRule:
        """The rule of degree d."""
        return radau_rule(self.degree)

    def quadrature(self, values: Array) -> Array:
        """Integrate values at the collocation points up to each of `times`, shape (K d + 1,).

        By the collocation polynomial on each interval, which at its end is the Radau quadrature.
        """
        pieces = np.diff(self.mesh)[:, None] * (
            values.reshape(-1, self.degree) @ self.rule.integration.T
        )
        starts = np.concatenate([[0.0], np.cumsum(pieces[:-1, -1])])
        return np.append(0.0, (starts[:, None] + pieces).ravel())

    def at_mesh(self) -> Array:
        """Return the states at the mesh points, shape (K + 1, n)."""
        return self.states[:: self.degree]

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return states (len, n) and v (len, k) at times >= 0, by the polynomials; rest beyond T."""
        states = interpolate(np.append(0.0, self.rule.nodes), self.mesh, self._by_interval, times)
        v = self.v.reshape(-1, self.degree, self.v.shape[1])
        inputs = interpolate(self.rule.nodes, self.mesh, v, times)
        beyond = times > self.mesh[-1]
        states[beyond], inputs[beyond] = 0.0, 0.0
        return states, inputs

    def accelerations(self, times: Array) -> Array:
        """Return the derivative of the lower half of the states, (len, n/2), by the polynomials."""
        derivative, _ = self.rule.coefficients
        velocities = self._by_interval[..., self.states.shape[1] // 2 :]
        slopes = np.einsum("kji,jl->kli", velocities, derivative) / np.diff(self.mesh)[:, None, None]
        found = interpolate(self.rule.nodes, self.mesh, slopes, times)
        found[times > self.mesh[-1]] = 0.0
        return found

    @property
    def _by_interval(self) -> Array:
        """States at the start and the points of each interval, (K, d + 1, n)."""
        d = self.degree
        first = np.arange(0, len(self.states) - 1, d)
        return np.asarray(self.states[first[:, None] + np.arange(d + 1)])

    def input_polynomial(self, interval: int) -> BarycentricInterpolator:
        """Return v of an interval as a polynomial of degree d - 1."""
        here = slice(interval * self.degree, (interval + 1) * self.degree)
        return _polynomial(self.times[1:][here], self.v[here])

    def state_polynomial(self, interval: int) -> BarycentricInterpolator:
        """Return the states of an interval as a polynomial of degree d."""
        here = slice(interval * self.degree, (interval + 1) * self.degree + 1)
        nodes = self.times[here].copy()
        nodes[0] = self.mesh[interval]
        return _polynomial(nodes, self.states[here])


def _polynomial(nodes: Array, values: Array) -> BarycentricInterpolator:
    # weights of our own: scipy takes the nodes in a random order, and rounds as that comes
    return BarycentricInterpolator(nodes, values, wi=barycentric_weights(nodes))
