"""A collocated trajectory, and its polynomials between the collocation points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from ..symbolic import Game
from ..symbolic.vehicle import Array


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

    def quadrature(self, values: Array) -> Array:
        """Integrate values at the collocation points up to each of `times`, shape (K d + 1,).

        By the collocation polynomial on each interval, which at its end is the Radau quadrature.
        """
        d = self.degree
        nodes = (self.times[1 : d + 1] - self.mesh[0]) / (self.mesh[1] - self.mesh[0])
        powers = np.arange(d)
        # integrals from 0 to each node of the polynomial through the nodes
        weights = (nodes[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(
            nodes[:, None] ** powers
        )
        pieces = np.diff(self.mesh)[:, None] * (values.reshape(-1, d) @ weights.T)
        starts = np.concatenate([[0.0], np.cumsum(pieces[:-1, -1])])
        return np.append(0.0, (starts[:, None] + pieces).ravel())

    def at_mesh(self) -> Array:
        """Return the states at the mesh points, shape (K + 1, n)."""
        return self.states[:: self.degree]

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return states (len, n) and v (len, k) at times >= 0, by the polynomials; rest beyond T."""
        states = np.zeros((len(times), self.states.shape[1]))
        inputs = np.zeros((len(times), self.v.shape[1]))
        owner = np.clip(np.searchsorted(self.mesh, times, side="right") - 1, 0, len(self.mesh) - 2)
        within = times <= self.mesh[-1]
        for i in np.unique(owner[within]):
            here = (owner == i) & within
            states[here] = self.state_polynomial(int(i))(times[here])
            inputs[here] = self.input_polynomial(int(i))(times[here])
        return states, inputs

    def input_polynomial(self, interval: int) -> BarycentricInterpolator:
        """Return v of an interval as a polynomial of degree d - 1."""
        d = self.degree
        here = slice(interval * d, (interval + 1) * d)
        return BarycentricInterpolator(self.times[1:][here], self.v[here])

    def state_polynomial(self, interval: int) -> BarycentricInterpolator:
        """Return the states of an interval as a polynomial of degree d."""
        d = self.degree
        here = slice(interval * d, (interval + 1) * d + 1)
        times = np.append(self.mesh[interval], self.times[1:][here.start : here.stop - 1])
        return BarycentricInterpolator(times, self.states[here])
