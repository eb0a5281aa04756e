"""Angles among the states: what is written a whole turn farther on is the same state.

A state is written the short way, within half a period, where it enters: as the start of a run or of a
solve, as the first measurement. Inside a run, a prediction or a solve it is continuous, so that the
cost counts how far it is from the origin that it goes to. What is within half a period keeps its very
floats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from ..arrays import Array
from ..errors import InputError

FARTHEST = 2.5  # periods of an angle that a start may be given with; degrees are more
# Part of a period beyond half of it at which a measured angle is written from the other side: what
# overshoots half a turn keeps its way home, and noise there does not turn the vehicle to and fro.
HYSTERESIS = 1.0 / 8.0
# Part of a period before half of it from which on the other turn's value is looked at too: 0.18 of a
# period from half of it at most are the two values equal (docs/theory/optimum.md).
BAND = 1.0 / 4.0


@dataclass(frozen=True)
class Equivalence:
    """A second way to write a state: ζ and signs * ζ + shift are one.

    Attributes
    ----------
    state, limit : the second is used where |ζ_i| of this state exceeds the limit
    signs, shift : (n,)
    """

    state: int
    limit: float
    signs: tuple[float, ...]
    shift: tuple[float, ...]


@dataclass(frozen=True)
class Angles:
    """Which states are angles, and how a state with angles is written.

    Attributes
    ----------
    periods : (n,) of each state that is an angle; 0 where a state is none
    equivalence : a second way to write a state, None without one
    """

    periods: tuple[float, ...]
    equivalence: Equivalence | None = None

    def turns(self, zeta: Array) -> Array:
        """Return how many whole periods each angle of ζ (n,) is away from the short way, (n,)."""
        safe = np.where(self._period > 0.0, self._period, np.inf)
        return np.asarray(np.round(zeta / safe))

    def wrapped(self, zeta: Array) -> Array:
        """Return ζ (n,) written the short way; the very same floats if it is."""
        short, other = self._less_turns(zeta, zeta), self.equivalence
        if other is None or abs(short[other.state]) <= other.limit:
            return short
        mirrored = np.array(other.signs) * short + np.array(other.shift)
        return self._less_turns(mirrored, mirrored)

    def start(self, zeta: Array) -> Array:
        """Return a start ζ (n,) written the short way, the second way only where that is no farther.

        What is beyond the limit without need, such as a pitch over 90 degrees of a vehicle that is
        level otherwise, stays as it is written: rather wrong than meant upside down.
        """
        short, second = self._less_turns(zeta, zeta), self.wrapped(zeta)
        turns = self._period > 0.0
        return second if np.abs(second[turns]).sum() <= np.abs(short[turns]).sum() else short

    def beside(self, zeta: Array, last: Array) -> Array:
        """Return ζ (n,) less whole periods, its angles within half a period of those of `last`."""
        return self._less_turns(zeta, zeta - last)

    def reentered(self, zeta: Array) -> Array:
        """Return ζ (n,) with its angles written the short way where they are farther than `HYSTERESIS`.

        Farther than that part of a period beyond half of one; the very same array if none is.
        """
        far = np.abs(zeta) > (1.0 + 2.0 * HYSTERESIS) * self._half
        if not far.any() or not np.isfinite(zeta).all():
            return zeta
        return np.where(far, zeta - self.turns(zeta) * self._period, zeta)

    def candidates(self, zeta: Array, P: Array) -> list[Array]:
        """Return the ways to write a start ζ (n,) from which the value may be least, itself first.

        The quadratic value ζ'P ζ is least over one angle alone where a = (P ζ)_i / P_ii is zero. So an
        angle counts from there, rates and other errors included, and where |a| exceeds half a period
        less `BAND` the other turn is a candidate too.

        Parameters
        ----------
        P : (n, n) of the quadratic value at the origin
        """
        if not self._period.any():
            return [zeta]
        shifts: list[tuple[float, ...]] = []
        for period, away in zip(self.periods, P @ zeta / np.diag(P), strict=True):
            both = period > 0.0 and abs(away) > (0.5 - BAND) * period
            shifts.append((0.0, -float(np.copysign(period, away))) if both else (0.0,))
        return [zeta + np.array(shift) if any(shift) else zeta for shift in product(*shifts)]

    def require_near(self, zeta: Array, names: Sequence[str], units: Sequence[str]) -> None:
        """Raise InputError for a start ζ (n,) with an angle of more turns than anybody writes."""
        for name, unit, value, period in zip(names, units, zeta, self.periods, strict=True):
            if period and abs(value) > FARTHEST * period:
                told = "angles are in rad" if unit == "rad" else f"a turn of it is {period:g}"
                raise InputError(
                    f"{name} is {value:g}, which is {abs(value) / period:.1f} turns; {told}, give it "
                    f"within {FARTHEST:g} turns"
                )

    @cached_property
    def _period(self) -> Array:
        return np.array(self.periods, dtype=float)

    @cached_property
    def _half(self) -> Array:
        return np.where(self._period > 0.0, 0.5 * self._period, np.inf)

    def _less_turns(self, zeta: Array, far: Array) -> Array:
        """Return ζ less the whole periods of `far`."""
        if (np.abs(far) <= self._half).all():
            return zeta
        return np.asarray(zeta - self.turns(far) * self._period)


class AngleTracker:
    """Measured angles as one continuous motion.

    The first measurement is written the short way, each further one within half a period of the last.
    Where that leads farther than `HYSTERESIS` of a period beyond half of it, the angle is written the
    short way again: by then the way on is by far the shorter one home.
    """

    def __init__(self, angles: Angles) -> None:
        self._angles = angles
        self._last: Array | None = None
        self._halves = [(i, 0.5 * period) for i, period in enumerate(angles.periods) if period]
        if angles.equivalence is not None:
            self._halves.append((angles.equivalence.state, angles.equivalence.limit))

    def enter(self, zeta: Array) -> Array:
        """Return the measured state (n,) as it continues the one before."""
        entered = self.seen(zeta)
        self.keep(entered)
        return entered

    def seen(self, zeta: Array, *, anew: bool = False) -> Array:
        """Return what `enter` would, and keep nothing; `anew`: as the first measurement."""
        last = None if anew else self._last
        if self._is_plain(zeta, zeta if last is None else last):
            return zeta
        angles, entered = self._angles, self._angles.wrapped(zeta)
        if last is not None:
            entered = angles.reentered(angles.beside(entered, last))
        return entered

    def keep(self, entered: Array) -> None:
        """Keep what was seen, for the next measurement to continue it."""
        self._last = entered

    def _is_plain(self, zeta: Array, last: Array) -> bool:
        """Return whether no angle is farther than half a period from zero, nor from the last."""
        for i, half in self._halves:
            angle = zeta[i]
            if not -half <= angle <= half or not -half <= angle - last[i] <= half:
                return False
        return True

    def forget(self) -> None:
        """Take the next measurement as the first: what it is measured from has moved."""
        self._last = None
