"""Kinematics (1): η_dot = J(η) ν with Z-Y-X Euler angles, and its inverse and rate in closed form.

η = (x, y, z, φ, θ, ψ) is the pose in the earth frame (z down), ν = (u, v, w, p, q, r) the velocity
in the body frame. J is singular at θ = ±π/2 (Assumption 1 keeps the pitch away from it).
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX

from ..game import Equivalence

_TURN, _SIX = 2.0 * np.pi, (0.0,) * 6
PERIODS = (*(0.0,) * 3, *(_TURN,) * 3, *_SIX)  # of the states (η, η_dot) [rad], 0 where one is no angle
# (φ, θ, ψ) and (φ + π, π - θ, ψ + π) are one attitude; the one with |θ| <= π/2 is used
SAME_ATTITUDE = Equivalence(
    state=4,
    limit=np.pi / 2,
    signs=(*(1.0,) * 4, -1.0, *(1.0,) * 5, -1.0, 1.0),
    shift=(*(0.0,) * 3, *(np.pi,) * 3, *_SIX),
)


def skew(a: SX) -> SX:
    """Return S(a) with S(a) b = a x b. `a`: shape (3,)."""
    return casadi.skew(a)


def rotation(eta: SX) -> SX:
    """Return J_1(η) of the paper, the rotation from body to earth, shape (3, 3)."""
    phi, theta, psi = eta[3], eta[4], eta[5]
    cf, sf = casadi.cos(phi), casadi.sin(phi)
    ct, st = casadi.cos(theta), casadi.sin(theta)
    cp, sp = casadi.cos(psi), casadi.sin(psi)
    return casadi.vertcat(
        casadi.horzcat(cp * ct, -sp * cf + cp * st * sf, sp * sf + cp * st * cf),
        casadi.horzcat(sp * ct, cp * cf + sp * st * sf, -cp * sf + sp * st * cf),
        casadi.horzcat(-st, ct * sf, ct * cf),
    )


def euler_rates(eta: SX) -> SX:
    """Return J_2(η) of the paper: Euler angle rates from body rates, shape (3, 3)."""
    phi, theta = eta[3], eta[4]
    cf, sf, ct, tt = casadi.cos(phi), casadi.sin(phi), casadi.cos(theta), casadi.tan(theta)
    return casadi.vertcat(
        casadi.horzcat(1, sf * tt, cf * tt),
        casadi.horzcat(0, cf, -sf),
        casadi.horzcat(0, sf / ct, cf / ct),
    )


def euler_rates_inverse(eta: SX) -> SX:
    """Return J_2(η)^-1: body rates from Euler angle rates, shape (3, 3); defined at any pitch."""
    phi, theta = eta[3], eta[4]
    cf, sf, ct, st = casadi.cos(phi), casadi.sin(phi), casadi.cos(theta), casadi.sin(theta)
    return casadi.vertcat(
        casadi.horzcat(1, 0, -st),
        casadi.horzcat(0, cf, ct * sf),
        casadi.horzcat(0, -sf, ct * cf),
    )


def euler_rates_dot(eta: SX, eta_dot: SX) -> SX:
    """Return d/dt J_2(η) = ∂J_2/∂φ φ_dot + ∂J_2/∂θ θ_dot, shape (3, 3)."""
    phi, theta = eta[3], eta[4]
    cf, sf = casadi.cos(phi), casadi.sin(phi)
    ct, st, tt = casadi.cos(theta), casadi.sin(theta), casadi.tan(theta)
    by_phi = casadi.vertcat(
        casadi.horzcat(0, cf * tt, -sf * tt),
        casadi.horzcat(0, -sf, -cf),
        casadi.horzcat(0, cf / ct, -sf / ct),
    )
    by_theta = casadi.vertcat(
        casadi.horzcat(0, sf / ct**2, cf / ct**2),
        casadi.horzcat(0, 0, 0),
        casadi.horzcat(0, sf * st / ct**2, cf * st / ct**2),
    )
    return by_phi * eta_dot[3] + by_theta * eta_dot[4]


def jacobian(eta: SX) -> SX:
    """Return J(η) = diag(J_1, J_2) of (1), shape (6, 6)."""
    return casadi.diagcat(rotation(eta), euler_rates(eta))


def jacobian_inverse(eta: SX) -> SX:
    """Return J(η)^-1 = diag(J_1', J_2^-1), shape (6, 6)."""
    return casadi.diagcat(rotation(eta).T, euler_rates_inverse(eta))


def jacobian_dot(eta: SX, eta_dot: SX) -> SX:
    """Return d/dt J(η) with J_1_dot = J_1 S(ω), shape (6, 6)."""
    omega = euler_rates_inverse(eta) @ eta_dot[3:]
    return casadi.diagcat(rotation(eta) @ skew(omega), euler_rates_dot(eta, eta_dot))
