"""Inverse dynamics and periods of a problem, held against its f and g at seeded points of its scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX

from ..arrays import Array
from ..errors import InputError


@dataclass(frozen=True, eq=False)
class InverseDynamics:
    """The input that gives a fully actuated plant a wanted acceleration.

    Attributes
    ----------
    acceleration : (k,) symbol a = η_ddot
    v : (k,) expression of ζ = (η, η_dot) and a with f(ζ) + g(ζ) v = (η_dot, a)
    """

    acceleration: SX
    v: SX


def require_inverse(
    name: str, zeta: SX, drift: SX, control_matrix: SX, inverse: InverseDynamics, scale: Array
) -> None:
    """Raise InputError where f + g v is not (η_dot, a)."""
    n, k = control_matrix.shape
    if n != 2 * k:
        raise InputError(f"{name}: inverse dynamics need 2 k states, but {n} is not 2 x {k}")
    wanted = casadi.vertcat(zeta[k:], inverse.acceleration)
    residual = casadi.Function(
        "residual", [zeta, inverse.acceleration], [drift + control_matrix @ inverse.v - wanted]
    )
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(3):
        at = residual(rng.uniform(-0.5, 0.5, n) * scale, rng.uniform(-1, 1, k))
        worst = max(worst, float(np.abs(np.array(DM(at))).max()))
    if not worst < 1e-9:
        raise InputError(
            f"{name}: the inverse dynamics contradict f and g by {worst:.2g}; correct them"
        )


def require_periodic(
    name: str, zeta: SX, terms: SX, scale: Array, names: Sequence[str], periods: Sequence[float]
) -> None:
    """Raise InputError unless there is a period or 0 for each state, and f and g have these periods."""
    n = len(names)
    if len(periods) != n or not all(np.isfinite(period) and period >= 0.0 for period in periods):
        raise InputError(
            f"{name}: the periods must be {n} numbers, the period of each state that is an angle and 0 "
            "for the others"
        )
    equations = casadi.Function("terms", [zeta], [casadi.densify(terms)])
    rng = np.random.default_rng(0)
    for state, period, unit in zip(names, periods, np.eye(n), strict=True):
        for _ in range(2 if period else 0):
            point = rng.uniform(-0.5, 0.5, n) * scale
            here, there = (np.array(DM(equations(at))) for at in (point, point + period * unit))
            if not np.allclose(there, here, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(here).max())):
                raise InputError(
                    f"{name}: {state} has the period {period:g}, but f or g is another one a period "
                    "farther on; correct the period, or give 0 where a state is no angle"
                )
