"""Dynamics (2) in the body frame, and in the earth frame as the paper's control-affine form (3).

    M ν_dot + C(ν) ν + D(ν) ν + g(η) = τ_b + τ_d                                        (2)
    M_bar η_ddot + C_bar η_dot + D_bar η_dot + g_bar = τ_bar_b + τ_bar_d
    ζ_dot = f(ζ) + g(ζ) (u_1 + u_2),  ζ = (η, η_dot),  u = J^-T τ                          (3)

Moving water (an extension of the paper): with the earth-frame water velocity v_c and acceleration
a_c at the vehicle, ν_c = (J_1' v_c, 0) and ν_r = ν - ν_c,

    M_RB ν_dot + C_RB(ν) ν + M_A ν_r_dot + C_A(ν_r) ν_r + D(ν_r) ν_r + g(η) = τ + F_K

with the Froude-Krylov force F_K = (B/g) J_1' a_c at the centre of buoyancy. For a steady current
this is M ν_r_dot + C(ν_r) ν_r + D(ν_r) ν_r + g = τ (Fossen 2011, property 8.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX

from ..arrays import Array
from . import kinematics
from .vehicle import Vehicle


def coriolis(M: Array, nu: SX) -> SX:
    """Return the Kirchhoff-consistent C(ν) for the inertia M (Fossen 2011, theorem 3.2).

    C = [[0, -S(M_11 v + M_12 ω)], [-S(M_11 v + M_12 ω), -S(M_21 v + M_22 ω)]], skew for every ν.
    Shape (6, 6).
    """
    momentum = DM(M) @ nu
    linear, angular = kinematics.skew(momentum[:3]), kinematics.skew(momentum[3:])
    return casadi.vertcat(
        casadi.horzcat(SX(3, 3), -linear),
        casadi.horzcat(-linear, -angular),
    )


def damping(vehicle: Vehicle, nu: SX) -> SX:
    """Return D(ν) = D_l + D_q diag(|ν|), shape (6, 6); only C^1 in D(ν) ν where ν changes sign."""
    return DM(vehicle.D_linear) + DM(vehicle.D_quadratic) @ casadi.diag(casadi.fabs(nu))


def restoring(vehicle: Vehicle, eta: SX) -> SX:
    """Return the gravity and buoyancy wrench g(η) of (2), shape (6,) (Fossen 2011, (4.6))."""
    down = kinematics.rotation(eta).T @ DM([0.0, 0.0, 1.0])
    r_g, r_b = DM(vehicle.center_of_gravity), DM(vehicle.center_of_buoyancy)
    W, B = vehicle.weight, vehicle.buoyancy
    return -casadi.vertcat((W - B) * down, casadi.cross(W * r_g - B * r_b, down))


@dataclass(frozen=True)
class EarthFrame:
    """The matrices of the earth-frame dynamics, as expressions of η, η_dot.

    M_bar = J^-T M J^-1, C_bar = J^-T (C - M J^-1 J_dot) J^-1, D_bar = J^-T D J^-1 (all (6, 6)) and
    g_bar = J^-T g (6,); M_bar_dot - 2 C_bar is skew.
    """

    M_bar: SX
    C_bar: SX
    D_bar: SX
    g_bar: SX


def earth_frame(vehicle: Vehicle, eta: SX, eta_dot: SX) -> EarthFrame:
    """Return M_bar, C_bar, D_bar and g_bar in still water, as defined under (2)."""
    J_inv = kinematics.jacobian_inverse(eta)
    nu = J_inv @ eta_dot
    M = DM(vehicle.M)
    inner = coriolis(vehicle.M, nu) - M @ J_inv @ kinematics.jacobian_dot(eta, eta_dot)
    return EarthFrame(
        M_bar=J_inv.T @ M @ J_inv,
        C_bar=J_inv.T @ inner @ J_inv,
        D_bar=J_inv.T @ damping(vehicle, nu) @ J_inv,
        g_bar=J_inv.T @ restoring(vehicle, eta),
    )


def acceleration(
    vehicle: Vehicle, zeta: SX, tau_b: SX, water_velocity: SX, water_acceleration: SX
) -> SX:
    """Return η_ddot under a body wrench in moving water (module docstring).

    Parameters
    ----------
    zeta : (12,) η [m, rad] and η_dot [m/s, rad/s]
    tau_b : (6,) body wrench [N, N m]
    water_velocity, water_acceleration : (3,) in the earth frame [m/s], [m/s^2]
    """
    eta, eta_dot = zeta[:6], zeta[6:]
    nu = kinematics.jacobian_inverse(eta) @ eta_dot
    total = tau_b + wrench(vehicle, zeta, water_velocity, water_acceleration)
    M_inverse = DM(np.linalg.inv(vehicle.M))
    J_dot = kinematics.jacobian_dot(eta, eta_dot)
    return kinematics.jacobian(eta) @ (M_inverse @ total) + J_dot @ nu


def wrench(vehicle: Vehicle, zeta: SX, water_velocity: SX, water_acceleration: SX) -> SX:
    """Return what acts on the vehicle without its actuators: M ν_dot at τ_b = 0, shape (6,).

    Parameters as for `acceleration`.
    """
    eta = zeta[:6]
    nu = kinematics.jacobian_inverse(eta) @ zeta[6:]
    to_body = kinematics.rotation(eta).T
    v_c, a_c = to_body @ water_velocity, to_body @ water_acceleration
    nu_r = nu - casadi.vertcat(v_c, SX(3, 1))
    nu_c_dot = casadi.vertcat(-casadi.cross(nu[3:], v_c) + a_c, SX(3, 1))
    displaced_force = vehicle.buoyancy / vehicle.gravity * a_c
    froude_krylov = casadi.vertcat(
        displaced_force, casadi.cross(DM(vehicle.center_of_buoyancy), displaced_force)
    )
    return (
        froude_krylov
        - restoring(vehicle, eta)
        - coriolis(vehicle.rigid_body_inertia, nu) @ nu
        - coriolis(vehicle.M_added, nu_r) @ nu_r
        - damping(vehicle, nu_r) @ nu_r
        + DM(vehicle.M_added) @ nu_c_dot
    )


def drift(vehicle: Vehicle, zeta: SX, current: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> SX:
    """Return f(ζ) of (3) in a known steady current [m/s], shape (12,).

    f = (η_dot, -M_bar^-1 (C_bar η_dot + D_bar η_dot + g_bar)), evaluated without forming M_bar^-1:
    η_ddot = J ν_dot + J_dot ν.
    """
    still = acceleration(vehicle, zeta, SX(6, 1), SX(DM(current)), SX(3, 1))
    return casadi.vertcat(zeta[6:], still)


def input_matrix(vehicle: Vehicle, zeta: SX) -> SX:
    """Return g(ζ) = (0, M_bar^-1) of (3) with M_bar^-1 = J M^-1 J', shape (12, 6)."""
    J = kinematics.jacobian(zeta[:6])
    return casadi.vertcat(SX(6, 6), J @ DM(np.linalg.inv(vehicle.M)) @ J.T)


def inverse_dynamics(
    vehicle: Vehicle, zeta: SX, eta_ddot: SX, current: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> SX:
    """Return the earth-frame force u that gives η_ddot in a known steady current, shape (6,).

    u = J^-T (M ν_dot - w) with ν_dot = J^-1 (η_ddot - J_dot ν) and w of `wrench`: (2) solved for the
    force, so that f(ζ) + g(ζ) u = (η_dot, η_ddot).
    """
    J_inv = kinematics.jacobian_inverse(zeta[:6])
    nu = J_inv @ zeta[6:]
    nu_dot = J_inv @ (eta_ddot - kinematics.jacobian_dot(zeta[:6], zeta[6:]) @ nu)
    still = wrench(vehicle, zeta, SX(DM(current)), SX(3, 1))
    return J_inv.T @ (DM(vehicle.M) @ nu_dot - still)


def relative_velocity(zeta: SX, current: tuple[float, float, float]) -> SX:
    """Return ν_r, shape (6,): the drag in f is only C^1 where one of its entries changes sign."""
    eta = zeta[:6]
    v_c = kinematics.rotation(eta).T @ DM(current)
    return kinematics.jacobian_inverse(eta) @ zeta[6:] - casadi.vertcat(v_c, SX(3, 1))
