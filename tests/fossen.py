"""An oracle: the six-degree-of-freedom model of Fossen (2011) in plain numpy.

It shares neither code nor formulae with `stationkeep.symbolic`. Rotations are composed of elementary
ones; C_RB is the velocity-independent parametrisation (3.57) instead of Kirchhoff's; the added mass is
the rate of change of the fluid's momentum, written as vectors; the Euler angles are differentiated
through T^-1, the sum of the three rate vectors; water is a moving frame.

Body frame x forward, y starboard, z down; earth frame z down; Z-Y-X Euler angles; SI units.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
E1, E2, E3 = np.eye(3)
SHIPPED = ("bluerov2-heavy", "bluerov2-heavy-buoyant", "bluerov2-heavy-2024", "rexrov")


def read_parameters(name: str) -> dict[str, Any]:
    """Return the raw parameters of a shipped vehicle."""
    file = resources.files("stationkeep.symbolic.underwater").joinpath("vehicles", f"{name}.toml")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def S(a: Array) -> Array:
    """Return the cross-product matrix, S(a) b = a x b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def turn(axis: int, angle: float) -> Array:
    """Return the elementary rotation about an axis, from the turned frame to the fixed one."""
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(angle)
    R[j, i], R[i, j] = np.sin(angle), -np.sin(angle)
    return R


def rotation(angles: Array) -> Array:
    """Return R, body to earth: yaw, then pitch, then roll (2.18)."""
    return turn(2, angles[2]) @ turn(1, angles[1]) @ turn(0, angles[0])


def rate_matrix(angles: Array) -> Array:
    """Return T^-1 with omega = T^-1 (phi, theta, psi)_dot, the sum of the three rates (2.26)."""
    Rx, Ry = turn(0, angles[0]), turn(1, angles[1])
    return np.column_stack([E1, Rx.T @ E2, Rx.T @ Ry.T @ E3])


def rate_matrix_dot(angles: Array, rates: Array) -> Array:
    """Return d/dt T^-1, from d/dt Rx' = -phi_dot S(e1) Rx' and the same for Ry'."""
    Rx, Ry = turn(0, angles[0]), turn(1, angles[1])
    of_pitch = -rates[0] * S(E1) @ Rx.T @ E2
    of_yaw = -rates[0] * S(E1) @ Rx.T @ Ry.T @ E3 - rates[1] * Rx.T @ S(E2) @ Ry.T @ E3
    return np.column_stack([np.zeros(3), of_pitch, of_yaw])


def jacobian(eta: Array) -> Array:
    """Return J(eta), shape (6, 6)."""
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = rotation(eta[3:]), np.linalg.inv(rate_matrix(eta[3:]))
    return J


class Body:
    """A vehicle's equations of motion from raw parameters (the keys of a vehicle file)."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        self.m = float(parameters["mass"])
        self.W = float(parameters["weight"])
        self.B = float(parameters["buoyancy"])
        self.displaced_mass = self.B / float(parameters["gravity"])
        self.r_g = np.array(parameters["center_of_gravity"], dtype=float)
        self.r_b = np.array(parameters["center_of_buoyancy"], dtype=float)
        self.I_o = np.array(parameters["inertia"], dtype=float)
        self.A = np.array(parameters["added_mass"], dtype=float)
        linear = np.array(parameters["linear_damping"], dtype=float)
        quadratic = np.array(parameters["quadratic_damping"], dtype=float)
        self.D_l = np.diag(linear) if linear.ndim == 1 else linear
        self.D_q = np.diag(quadratic) if quadratic.ndim == 1 else quadratic
        M_RB = np.zeros((6, 6))
        M_RB[:3, :3] = self.m * np.eye(3)
        M_RB[:3, 3:] = -self.m * S(self.r_g)
        M_RB[3:, :3] = self.m * S(self.r_g)
        M_RB[3:, 3:] = self.I_o
        self.M = M_RB + self.A

    def inertial(self, nu: Array) -> Array:
        """Return C_RB(nu) nu with C_RB of (3.57): no linear velocity in the matrix."""
        w = S(nu[3:])
        C_RB = np.zeros((6, 6))
        C_RB[:3, :3], C_RB[:3, 3:] = self.m * w, -self.m * w @ S(self.r_g)
        C_RB[3:, :3], C_RB[3:, 3:] = self.m * S(self.r_g) @ w, -S(self.I_o @ nu[3:])
        return np.asarray(C_RB @ nu)

    def fluid(self, nu_r: Array) -> Array:
        """Return what turning adds to the rate of the fluid's momentum (p, L) about CO.

        In a turning frame the force is dp/dt + omega x p, the moment dL/dt + omega x L + v x p.
        """
        v, w = nu_r[:3], nu_r[3:]
        p, L = np.split(self.A @ nu_r, 2)
        return np.concatenate([S(w) @ p, S(w) @ L + S(v) @ p])

    def drag(self, nu_r: Array) -> Array:
        """Return the wrench of linear and quadratic damping, D_l nu + D_q |nu| nu."""
        return np.asarray(self.D_l @ nu_r + self.D_q @ (np.abs(nu_r) * nu_r))

    def hydrostatic(self, R: Array) -> Array:
        """Return the wrench of weight at r_g (down, +z) and buoyancy at r_b (up)."""
        weight, buoyancy = self.W * R.T @ E3, -self.B * R.T @ E3
        return np.concatenate([weight + buoyancy, S(self.r_g) @ weight + S(self.r_b) @ buoyancy])

    def acceleration(
        self,
        zeta: Array,
        wrench: ArrayLike = (0, 0, 0, 0, 0, 0),
        water_velocity: ArrayLike = (0, 0, 0),
        water_acceleration: ArrayLike = (0, 0, 0),
    ) -> Array:
        """Return eta_ddot, shape (6,), under a body wrench in water that moves uniformly.

        Accelerating water carries the pressure gradient that accelerates it: on the displaced mass
        B/g at r_b it is the Froude-Krylov force. The added mass feels the relative acceleration.
        """
        eta, eta_dot = zeta[:6], zeta[6:]
        R, T_inverse = rotation(eta[3:]), rate_matrix(eta[3:])
        v, w = R.T @ eta_dot[:3], T_inverse @ eta_dot[3:]
        v_c = R.T @ np.asarray(water_velocity, dtype=float)
        a_c = R.T @ np.asarray(water_acceleration, dtype=float)
        nu, nu_r = np.concatenate([v, w]), np.concatenate([v - v_c, w])
        # d/dt (R' v_c) = -omega x R' v_c + R' a_c
        water_rate = np.concatenate([-S(w) @ v_c + a_c, np.zeros(3)])
        froude_krylov = self.displaced_mass * np.concatenate([a_c, S(self.r_b) @ a_c])
        balance = np.asarray(wrench, dtype=float) + self.hydrostatic(R) + froude_krylov
        balance = balance - self.inertial(nu) - self.fluid(nu_r) - self.drag(nu_r) + self.A @ water_rate
        nu_dot = np.linalg.solve(self.M, balance)
        linear = R @ (nu_dot[:3] + S(w) @ v)
        angular = np.linalg.solve(
            T_inverse, nu_dot[3:] - rate_matrix_dot(eta[3:], eta_dot[3:]) @ eta_dot[3:]
        )
        return np.concatenate([linear, angular])

    def input_matrix(self, eta: Array) -> Array:
        """Return the lower half of g, J M^-1 J', shape (6, 6): earth-frame force to acceleration."""
        J = jacobian(eta)
        return np.asarray(J @ np.linalg.solve(self.M, J.T))

    def energy(self, zeta: Array) -> float:
        """Return kinetic energy (with the fluid's) and the potential of weight and buoyancy [J]."""
        eta, eta_dot = zeta[:6], zeta[6:]
        R = rotation(eta[3:])
        nu = np.concatenate([R.T @ eta_dot[:3], rate_matrix(eta[3:]) @ eta_dot[3:]])
        depth_g, depth_b = eta[2] + (R @ self.r_g)[2], eta[2] + (R @ self.r_b)[2]
        return float(0.5 * nu @ self.M @ nu - self.W * depth_g + self.B * depth_b)

    def dissipation(self, zeta: Array) -> float:
        """Return nu'D(nu) nu in still water [W]."""
        nu = np.linalg.solve(jacobian(zeta[:6]), zeta[6:])
        return float(nu @ self.drag(nu))


def synthetic_parameters() -> dict[str, Any]:
    """Return a vehicle without any symmetry: nothing that is zero or diagonal in the others is here."""
    rng = np.random.default_rng(7)
    factor = rng.uniform(-1.0, 1.0, (6, 6))
    size = np.sqrt([9.0, 12.0, 20.0, 0.5, 0.6, 0.7])
    added_mass = size[:, None] * (factor @ factor.T / 6 + np.eye(6)) * size
    unsymmetric = rng.uniform(-0.1, 0.1, (6, 6))
    return {
        "name": "no symmetry",
        "source": "made up",
        "units": "SI",
        "mass": 15.0,
        "weight": 147.0,
        "buoyancy": 151.0,
        "gravity": 9.81,
        "center_of_gravity": [0.05, -0.03, 0.04],
        "center_of_buoyancy": [-0.02, 0.04, -0.06],
        "inertia": [[0.5, 0.03, -0.05], [0.03, 0.6, 0.02], [-0.05, 0.02, 0.7]],
        "added_mass": (0.5 * (added_mass + added_mass.T)).tolist(),
        "linear_damping": (np.diag([13.0, 17, 33, 1, 0.8, 1.2]) + unsymmetric).tolist(),
        "quadratic_damping": (np.diag([141.0, 217, 190, 1.2, 1.1, 1.5]) + unsymmetric.T).tolist(),
    }


PARAMETERS = {name: read_parameters(name) for name in SHIPPED} | {"synthetic": synthetic_parameters()}


def random_states(n: int = 1000, seed: int = 1) -> Array:
    """Return states anywhere, at any attitude with the pitch inside ±1.2 rad, rates up to 1.5."""
    half = np.array([5, 5, 5, np.pi, 1.2, np.pi, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5])
    return np.random.default_rng(seed).uniform(-half, half, (n, 12))
