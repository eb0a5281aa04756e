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

from collections.abc import Callable
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
    radius_at = _radius(problem, period)
    margin = _last(lambda factor: radius_at(factor) < 1.0, 8.0, 40)
    return HeldLoop(radius_at(1.0), _bound(problem, period), margin)


def can_hold(problem: Problem, period: float) -> bool:
    """Whether a control held for `period` [s] keeps what `HeldLoop.holds` asks for."""
    return held_radius(problem, period) <= _bound(problem, period)


def held_radius(problem: Problem, period: float) -> float:
    """Return the spectral radius over a period [s]: of both players' loop, and of u_1 alone.

    The larger of the two: nothing needs to disturb.
    """
    return _radius(problem, period)(1.0)


def _radius(problem: Problem, period: float) -> Callable[[float], float]:
    """Return the spectral radius as a function of a factor that the gains are multiplied with."""
    A, B = problem.linearization
    n, k = B.shape
    powers = scipy.linalg.expm(period * np.block([[A, B], [np.zeros((k, n + k))]]))
    gains = (problem.linear_gain, -problem.linear_gains[0])

    def at(factor: float) -> float:
        closed = (powers[:n, :n] + factor * powers[:n, n:] @ gain for gain in gains)
        return max(float(np.abs(np.linalg.eigvals(matrix)).max()) for matrix in closed)

    return at


def _bound(problem: Problem, period: float) -> float:
    return float(np.exp(-MARGIN * problem.decay_rate * period))


def _last(holds: Callable[[float], bool], most: float, halvings: int) -> float:
    """Return the largest number up to `most` until which something holds, by bisection."""
    if holds(most):
        return most
    low, high = 0.0, most
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def longest_period(problem: Problem, most: float) -> float:
    """Return the longest period that holds the game, to two digits and at most `most` [s]."""
    longest = _last(lambda period: can_hold(problem, period), most, 40)
    if longest == most:
        return most
    exponent = np.floor(np.log10(longest)) - 1.0 if longest > 0.0 else 0.0
    return float(np.floor(longest / 10.0**exponent) * 10.0**exponent)


def longest_hold(problem: Problem, most: float) -> float:
    """Return how long a control may be held until the linearised loop gets unstable, up to `most` [s].

    Where its modes over one period reach the unit circle; `longest_period` keeps a margin from there.
    """
    return _last(lambda period: held_radius(problem, period) < 1.0, most, 30)


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
    return phi_functions(problem.closed_loop * period)[1]
