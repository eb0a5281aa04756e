"""The linearised loop when its control is held: whether the control period can hold the game.

The inputs are computed every h and held, so that the linearised plant goes from period to period by

    ζ_{k+1} = Φ(h) ζ_k + Γ(h) u_k,   Φ(h) = e^{Ah},   Γ(h) = ∫_0^h e^{As} ds B

(zero-order hold; Franklin, Powell and Workman 1998, ch. 4). Modes of the plant itself decay under a
hold as they do without it, however fast they are. What the feedback makes fast has to be slow against
the period.

A policy that was found for continuous time is best held at what it would ask for on average over the
period. To first order that is its value at the mean state of the closed loop A_c over it,

    ζ_mean = 1/h ∫_0^h e^{A_c s} ds ζ = φ_1(A_c h) ζ,

with which the state at the end of the period is that of the continuous loop up to the plant's own decay
within a period.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..arrays import Array
from ..integration import phi_functions
from .problem import Problem

MARGIN = 0.5  # of the continuous loop's decay rate; the least that the held loop must decay with
MEAN_FROM = 0.25  # of the period times the fastest mode, from which on the mean state is used


@dataclass(frozen=True)
class HeldLoop:
    """The linearised game's loop with both inputs held, or the control alone.

    Attributes
    ----------
    radius : largest modulus of its modes over one period [-]; the loop is stable below 1
    bound : what the radius has to stay below, e^{-α h / 2} with α the continuous loop's decay rate
    gain_margin : what the gains may be multiplied with until the radius is 1 [-], up to 8
    """

    radius: float
    bound: float
    gain_margin: float

    @property
    def holds(self) -> bool:
        """Whether the control period can hold the game."""
        return self.radius <= self.bound


def held_loop(problem: Problem, period: float) -> HeldLoop:
    """Return the loop under the linear policies, held for `period` [s]."""
    margin = _gain_margin(problem, period)
    return HeldLoop(held_radius(problem, period), _bound(problem, period), margin)


def _bound(problem: Problem, period: float) -> float:
    return float(np.exp(-MARGIN * problem.decay_rate * period))


def held_radius(problem: Problem, period: float, factor: float = 1.0) -> float:
    """Return the spectral radius with the gains times a factor: of both players, and of u_1 alone.

    The larger of the two: nothing needs to disturb.
    """
    A, B = problem.linearization
    n, k = B.shape
    powers = scipy.linalg.expm(period * np.block([[A, B], [np.zeros((k, n + k))]]))
    gains = (problem.linear_gain, -problem.linear_gains[0])
    closed = (powers[:n, :n] + factor * powers[:n, n:] @ gain for gain in gains)
    return max(float(np.abs(np.linalg.eigvals(matrix)).max()) for matrix in closed)


def longest_period(problem: Problem, most: float) -> float:
    """Return the longest period that holds the game, to two digits and at most `most` [s]."""
    low, high = 0.0, most
    for _ in range(40):
        middle = 0.5 * (low + high)
        holds = held_radius(problem, middle) <= _bound(problem, middle)
        low, high = (middle, high) if holds else (low, middle)
    exponent = np.floor(np.log10(low)) - 1.0 if low > 0.0 else 0.0
    return float(np.floor(low / 10.0**exponent) * 10.0**exponent)


def longest_hold(problem: Problem, most: float) -> float:
    """Return how long a control may be held until the linearised loop gets unstable, up to `most` [s].

    Where its modes over one period reach the unit circle; `longest_period` keeps a margin from there.
    """
    if held_radius(problem, most) < 1.0:
        return most
    low, high = 0.0, most
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if held_radius(problem, middle) < 1.0 else (low, middle)
    return low


def fastest_mode(problem: Problem) -> tuple[float, str]:
    """Return |λ| of the fastest mode of the closed loop [1/s], and the state that it moves most.

    Of the loops under both players and under u_1 alone. States are weighed by the envelope's
    half-widths; the name is the problem's own.
    """
    A, B = problem.linearization
    found = []
    for gain in (problem.linear_gain, -problem.linear_gains[0]):
        values, vectors = np.linalg.eig(A + B @ gain)
        fastest = int(np.abs(values).argmax())
        moved = np.abs(vectors[:, fastest]) / problem.scale
        found.append((float(np.abs(values[fastest])), problem.state_names[int(moved.argmax())]))
    return max(found)


def mean_matrix(problem: Problem, period: float) -> Array:
    """Return φ_1(A_c h), (n, n), which makes the state its mean over the period [s]."""
    A, B = problem.linearization
    return phi_functions((A + B @ problem.linear_gain) * period)[1]


def _gain_margin(problem: Problem, period: float) -> float:
    low, high = 0.0, 8.0
    if held_radius(problem, period, high) < 1.0:
        return high
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if held_radius(problem, period, middle) < 1.0 else (low, middle)
    return low
