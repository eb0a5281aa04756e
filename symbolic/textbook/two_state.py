"""The two-state game whose value is known in closed form, although its plant is nonlinear.

    c = cos(2 ζ_1) + 2,   k = 1/R - 1/γ^2,   Q = I,   g = (0, c)
    f = (-ζ_1 + ζ_2, -ζ_1/2 - ζ_2/2 (1 - k c^2))
    V* = ζ_1^2 / 2 + ζ_2^2

The residual of (7) is exactly zero for any R > 0 and γ^2 > R. After Vamvoudakis and Lewis 2010, Online
actor-critic algorithm to solve the continuous-time infinite horizon optimal control problem,
Automatica 46(5), section 5.2, with a disturbance in the channel of the control.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX

from ..game import Game, Problem

STATE_NAMES = ("x_1", "x_2")


def two_state_game(R: float = 1.0, gamma: float = 2.0) -> Problem:
    """Return the game with V* = ζ_1^2 / 2 + ζ_2^2: weights (1/2, 0, 1) on (ζ_1^2, ζ_1 ζ_2, ζ_2^2).

    Parameters
    ----------
    R : control weight, positive
    gamma : attenuation level γ with γ^2 > R; infinity removes the disturbance player [-]

    Raises
    ------
    InputError
        If R is not a positive number; GammaTooSmallError if γ^2 <= R.
    """
    zeta = SX.sym("zeta", 2)
    game = Game(np.eye(2), np.array([R]), np.eye(1), gamma)
    c = casadi.cos(2 * zeta[0]) + 2
    k = 1 / R - gamma**-2
    drift = casadi.vertcat(-zeta[0] + zeta[1], -zeta[0] / 2 - zeta[1] / 2 * (1 - k * c**2))
    g, scale = casadi.vertcat(SX(1, 1), c), np.array([2.0, 2.0])
    return Problem("two-state game", zeta, drift, g, game, scale, state_names=STATE_NAMES)
