"""The domain of a problem: where its equations have a meaning."""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX
from numpy.typing import ArrayLike

from ..arrays import Array
from ..errors import InputError


@dataclass(frozen=True, eq=False)
class Bound:
    """A bound of a problem's domain: outside it the equations have no meaning.

    Attributes
    ----------
    margin : expression of ζ that is positive inside
    sentence : what is required and what to do, for a message; `{}` in it is the value shown
    shown : expression of ζ whose value the sentence gives; the margin itself if None
    """

    margin: SX
    sentence: str
    shown: SX | None = None


def margins_and_shown(zeta: SX, bounds: Sequence[Bound]) -> casadi.Function:
    """Return the margins of the bounds, and what their sentences show, as a function of ζ."""
    margins = casadi.vertcat(*(bound.margin for bound in bounds))
    shown = [bound.margin if bound.shown is None else bound.shown for bound in bounds]
    return casadi.Function("domain", [zeta], [margins, casadi.vertcat(*shown)])


def outside(bounds: Sequence[Bound], function: casadi.Function, zeta: Array) -> str | None:
    """Return the sentence of the first bound that ζ (n,) does not keep, or None.

    `function`: `margins_and_shown` of the bounds.
    """
    margins, shown = (np.array(values).ravel() for values in function(zeta))
    for bound, margin, value in zip(bounds, margins, shown, strict=True):
        if not margin > 0.0:
            return bound.sentence.format(f"{value:.1f}")
    return None


def require_numbers(zeta: ArrayLike, names: Sequence[str]) -> Array:
    """Return a state as an array of finite numbers, one for each of its names, (n,).

    Raises
    ------
    InputError
        One sentence about what is wrong.
    """
    n = len(names)
    try:
        state = np.array(zeta, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"a state must be {n} numbers") from None
    if state.shape != (n,):
        raise InputError(
            f"a state must be {n} numbers ({','.join(names)}), but its shape is {state.shape}"
        )
    if not np.isfinite(state).all():
        raise InputError("a state must be finite, but it contains NaN or infinity")
    return state


def require_time_step(dt: object) -> float:
    """Return a time step [s] as a float.

    Raises
    ------
    InputError
        Unless it is a positive finite number.
    """
    if isinstance(dt, np.ndarray) and dt.shape == ():
        dt = dt[()]
    if not isinstance(dt, numbers.Real) or isinstance(dt, (bool, np.bool_)):
        raise InputError(f"dt is a {type(dt).__name__}, but must be a positive time in seconds")
    step = float(dt)
    if not 0.0 < step < math.inf:
        raise InputError(f"dt is {step:g}, but must be a positive time in seconds")
    return step
