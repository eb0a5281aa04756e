"""A collocated trajectory, and its polynomials between the collocation points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator

from ..symbolic import Game
from ..symbolic.vehicle import Array
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
        owner, tau = self._locate(times)
        points = owner[:, None] * self.degree + np.arange(self.degree + 1)
        at_states = self.rule.interpolation(tau, start=True)
        at_inputs = self.rule.interpolation(tau, start=False)
        states = np.einsum("tj,tji->ti", at_states, self.states[points])
        inputs = np.einsum("tj,tji->ti", at_inputs, self.v[points[:, :-1]])
        beyond = times > self.mesh[-1]
        states[beyond], inputs[beyond] = 0.0, 0.0
        return states, inputs

    def accelerations(self, times: Array) -> Array:
        """Return the derivative of the lower half of the states, (len, n/2), by the polynomials."""
        owner, tau = self._locate(times)
        derivative, _ = self.rule.coefficients
        points = owner[:, None] * self.degree + np.arange(self.degree + 1)
        half = self.states.shape[1] // 2
        slopes = np.einsum("tji,jl->tli", self.states[points][..., half:], derivative)
        at_nodes = slopes / np.diff(self.mesh)[owner, None, None]
        found = np.einsum("tj,tji->ti", self.rule.interpolation(tau, start=False), at_nodes)
        found[times > self.mesh[-1]] = 0.0
        return np.asarray(found)

    def _locate(self, times: Array) -> tuple[NDArray[np.intp], Array]:
        """Return the interval of each time, and where in it, 0 to 1."""
        owner = np.clip(np.searchsorted(self.mesh, times, side="right") - 1, 0, len(self.mesh) - 2)
        return owner, (times - self.mesh[owner]) / np.diff(self.mesh)[owner]

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
    gaps = (nodes[:, None] - nodes) / (np.ptp(nodes) or 1.0) + np.eye(len(nodes))
    return BarycentricInterpolator(nodes, values, wi=1.0 / np.prod(gaps, axis=1))
