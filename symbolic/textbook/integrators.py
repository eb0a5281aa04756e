"""Double integrators, alone or in a chain: a linear game of any size with its value in closed form.

    q_ddot = -k L q - c L q_dot + v

n unit masses, each with an input of its own; springs k and dampers c, if any, join neighbours, and L
(n, n) is the Laplacian of the path 1 - 2 - ... - n: tridiagonal, -1 beside the diagonal, row sums 0.
The states are ζ = (q, q_dot), and V* = ζ'P ζ exactly.

Q weighs all positions with q_p and all velocities with q_v, and R all inputs with r. So the
eigenvectors of L part the game into n games of two states: with κ = k λ, δ = c λ and the eigenvalues
λ_j = 4 sin^2(π (j - 1) / 2n),

    ρ = r / (1 - γ^-2)                            (R_eff; W_d = R)
    p_12 = ρ (sqrt(κ^2 + q_p / ρ) - κ)
    p_22 = ρ (sqrt(δ^2 + (q_v + 2 p_12) / ρ) - δ)
    p_11 = κ p_22 + δ p_12 + p_12 p_22 / ρ

solve the Riccati equation of the j-th. Without springs and dampers every mass is such a game by itself:
p_12 = sqrt(q_p ρ), p_22 = sqrt(ρ (q_v + 2 p_12)), p_11 = p_12 p_22 / ρ.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from ..errors import InputError
from ..game import Game, InverseDynamics, Problem


def state_names(n: int) -> tuple[str, ...]:
    """Return q_1 ... q_n, q_dot_1 ... q_dot_n."""
    return tuple(f"{symbol}_{i}" for symbol in ("q", "q_dot") for i in range(1, n + 1))


def state_units(n: int) -> tuple[str, ...]:
    """Return the units of the 2n states."""
    return ("m",) * n + ("m/s",) * n


def double_integrators(
    n: int = 6,
    *,
    stiffness: float = 0.0,
    damping: float = 0.0,
    position_weight: float = 1.0,
    velocity_weight: float = 1.0,
    input_weight: float = 1.0,
    gamma: float = 2.0,
) -> Problem:
    """Return n double integrators: 2n states, n inputs, with inverse dynamics.

    Parameters
    ----------
    n : number of masses, at least 1
    stiffness, damping : k [N/m] and c [N s/m] between neighbours, 0 or more
    position_weight, velocity_weight, input_weight : q_p, q_v and r, positive; W_d = R
    gamma : attenuation level γ > 1 [-]

    Raises
    ------
    InputError
        If a parameter is out of these bounds; GammaTooSmallError if γ <= 1.
    """
    if n < 1:
        raise InputError(f"n is {n}, but there must be at least one double integrator")
    for name, value in (("stiffness", stiffness), ("damping", damping)):
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"the {name} is {value:g}, but must be a finite number from 0")
    zeta, a = SX.sym("zeta", 2 * n), SX.sym("acceleration", n)
    q, q_dot = zeta[:n], zeta[n:]
    joint = DM(_laplacian(n)) @ (stiffness * q + damping * q_dot)
    weights = np.repeat([position_weight, velocity_weight], n)
    R = np.full(n, input_weight)
    return Problem(
        name=f"chain of {n} masses" if stiffness or damping else f"{n} double integrators",
        zeta=zeta,
        drift=casadi.vertcat(q_dot, casadi.densify(-joint)),
        control_matrix=casadi.vertcat(SX(n, n), SX.eye(n)),
        game=Game(weights, R, R, gamma),
        scale=np.full(2 * n, 2.0),
        state_names=state_names(n),
        state_units=state_units(n),
        input_units=("m/s^2",) * n,
        inverse_dynamics=InverseDynamics(a, a + joint),
    )


def _laplacian(n: int) -> NDArray[np.float64]:
    steps = np.diff(np.eye(n), axis=0)  # q_{j+1} - q_j of neighbours, (n - 1, n)
    return steps.T @ steps
