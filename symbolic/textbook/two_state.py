"""The two-state game whose value is known in closed form."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX

from ..game import Game, Problem


def two_state_game(R: float = 1.0, gamma: float = 2.0) -> Problem:
    """Return the two-state game with the known value V* = ζ_1^2 / 2 + ζ_2^2.

    c = cos(2 ζ_1) + 2, k = 1/R - 1/γ^2, Q = I, g = (0, c) and
    f = (-ζ_1 + ζ_2, -ζ_1/2 - ζ_2/2 (1 - k c^2)). The residual of (7) is exactly zero, so the ideal
    weights on (ζ_1^2, ζ_1 ζ_2, ζ_2^2) are (1/2, 0, 1) for any R > 0 and γ^2 > R (after Vamvoudakis
    and Lewis 2010, with the disturbance in the same channel).
    """
    zeta = SX.sym("zeta", 2)
    c = casadi.cos(2 * zeta[0]) + 2
    game = Game(np.eye(2), np.array([R]), np.eye(1), gamma)
    k = 1 / R - gamma**-2
    drift = casadi.vertcat(-zeta[0] + zeta[1], -zeta[0] / 2 - zeta[1] / 2 * (1 - k * c**2))
    return Problem(
        "two-state game", zeta, drift, casadi.vertcat(SX(1, 1), c), game, np.array([2.0, 2.0])
    )
