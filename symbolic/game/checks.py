"""What a problem's equations must keep, seen at seeded points of its scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import casadi
import numpy as np
from casadi import DM

from ..errors import InputError

if TYPE_CHECKING:
    from .problem import InverseDynamics, Problem


def require_inverse(problem: Problem, inverse: InverseDynamics) -> None:
    """Raise InputError where f + g v is not (η_dot, a)."""
    n, k = problem.n_states, problem.n_inputs
    if n != 2 * k:
        raise InputError(f"{problem.name}: inverse dynamics need 2 k states, but {n} is not 2 x {k}")
    wanted = casadi.vertcat(problem.zeta[k:], inverse.acceleration)
    residual = casadi.Function(
        "residual",
        [problem.zeta, inverse.acceleration],
        [problem.drift + problem.control_matrix @ inverse.v - wanted],
    )
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(3):
        at = residual(rng.uniform(-0.5, 0.5, n) * problem.scale, rng.uniform(-1, 1, k))
        worst = max(worst, float(np.abs(np.array(DM(at))).max()))
    if not worst < 1e-9:
        raise InputError(
            f"{problem.name}: the inverse dynamics contradict f and g by {worst:.2g}; correct them"
        )


def require_periodic(problem: Problem, periods: Sequence[float]) -> None:
    """Raise InputError unless there is a period or 0 for each state, and f and g have these periods."""
    n, name = problem.n_states, problem.name
    if len(periods) != n or not all(np.isfinite(period) and period >= 0.0 for period in periods):
        raise InputError(
            f"{name}: the periods must be {n} numbers, the period of each state that is an angle and 0 "
            "for the others"
        )
    terms = casadi.densify(
        casadi.horzcat(problem.drift, problem.control_matrix, problem.disturbance_matrix)
    )
    equations = casadi.Function("terms", [problem.zeta], [terms])
    rng = np.random.default_rng(0)
    for i in np.flatnonzero(periods):
        for _ in range(2):
            zeta = rng.uniform(-0.5, 0.5, n) * problem.scale
            here, there = (
                np.array(DM(equations(zeta + turns * periods[i] * np.eye(n)[i]))) for turns in (0, 1)
            )
            if not np.allclose(there, here, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(here).max())):
                raise InputError(
                    f"{name}: {problem.state_names[i]} has the period {periods[i]:g}, but f or g is "
                    "another one a period farther on; correct the period, or give 0 where a state is "
                    "no angle"
                )
