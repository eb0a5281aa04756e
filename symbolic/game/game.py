"""The two-player zero-sum game (4)-(9) and its single-player equivalent.

    r(ζ, u_1, u_2) = ζ'Q ζ + u_1'R u_1 - γ^2 u_2'W_d u_2                                  (5)
    H = r + V_ζ (f + g (u_1 + u_2))                                                       (6)
    u_1* = -1/2 R^-1 g'V_ζ',   u_2* = 1/(2 γ^2) W_d^-1 g'V_ζ'                             (8)(9)

W_d = I is the paper's (5); W_d weighs forces against moments. Both players enter through the same
g, so the stationary Hamiltonian is ζ'Qζ + V_ζ f - 1/4 V_ζ g (R^-1 - γ^-2 W_d^-1) g'V_ζ', and with
R_eff = (R^-1 - γ^-2 W_d^-1)^-1 > 0 the game has the value of the single-player problem

    V(ζ) = min over v of the integral of ζ'Q ζ + v'R_eff v,   v = u_1 + u_2,
    u_1* = R^-1 R_eff v*,   u_2* = -γ^-2 W_d^-1 R_eff v*.

Departs from the paper: (26) is printed as λ_min(R) >= γ^2; what the proof and the existence of a
C^1 value need is the opposite, R^-1 - γ^-2 W_d^-1 > 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..errors import GammaTooSmallError, InputError


def weight_matrix(name: str, value: ArrayLike) -> Array:
    """Return a weight of (5) as a matrix; a one-dimensional `value` is its diagonal.

    Raises
    ------
    InputError
        If it is not a finite symmetric positive definite matrix; `name` appears in the message.
    """
    try:
        matrix = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a matrix of numbers") from None
    if matrix.ndim == 1:
        matrix = np.diag(matrix)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
        raise InputError(f"{name} has shape {matrix.shape}, but must be a diagonal or square matrix")
    if not np.all(np.isfinite(matrix)):
        raise InputError(f"{name} contains a number that is not finite; correct it")
    if np.abs(matrix - matrix.T).max() > 1e-10 * np.abs(matrix).max():
        raise InputError(f"{name} must be symmetric; give (A + A')/2")
    smallest = float(np.linalg.eigvalsh(matrix).min())
    if smallest <= 0.0:
        raise InputError(
            f"{name} must be positive definite, but its smallest eigenvalue is {smallest:.4g}; "
            "give every state and input a positive weight"
        )
    matrix.setflags(write=False)
    return matrix


def gamma_threshold(R: Array, W_d: Array) -> float:
    """Return the infimum of γ with R^-1 - γ^-2 W_d^-1 > 0, sqrt(λ_max(W_d^-1 R)) [-]."""
    return float(np.sqrt(np.linalg.eigvals(np.linalg.solve(W_d, R)).real.max()))


@dataclass(frozen=True, eq=False)
class Game:
    """Weights of the game; a one-dimensional weight is a diagonal.

    Parameters
    ----------
    Q : (n, n) state weight of (5), positive definite
    R : (k, k) control weight of (5), positive definite
    W_d : (k, k) disturbance weight, positive definite; the paper's is the identity
    gamma : attenuation level γ of (5) [-]; infinity removes the disturbance player

    Raises
    ------
    InputError
        If a weight is not symmetric positive definite or the shapes disagree.
    GammaTooSmallError
        If R^-1 - γ^-2 W_d^-1 is not positive definite.
    """

    Q: Array
    R: Array
    W_d: Array
    gamma: float

    def __post_init__(self) -> None:
        for name in ("Q", "R", "W_d"):
            object.__setattr__(self, name, weight_matrix(name, getattr(self, name)))
        if self.R.shape != self.W_d.shape:
            raise InputError(
                f"R is {self.R.shape} but W_d is {self.W_d.shape}; they must have the same shape"
            )
        if not self.gamma > 0.0:
            raise InputError(f"gamma is {self.gamma}, but must be a positive number")
        threshold = gamma_threshold(self.R, self.W_d)
        if self.gamma <= threshold:
            raise GammaTooSmallError(self.gamma, threshold)

    @cached_property
    def R_inverse(self) -> Array:
        """R^-1, shape (k, k)."""
        return np.asarray(np.linalg.inv(self.R), dtype=np.float64)

    @cached_property
    def disturbance_inverse(self) -> Array:
        """γ^-2 W_d^-1, shape (k, k)."""
        return np.asarray(np.linalg.inv(self.W_d) * float(self.gamma) ** -2, dtype=np.float64)

    @cached_property
    def R_eff_inverse(self) -> Array:
        """R^-1 - γ^-2 W_d^-1, shape (k, k)."""
        difference = self.R_inverse - self.disturbance_inverse
        return 0.5 * (difference + difference.T)

    @cached_property
    def R_eff(self) -> Array:
        """Control weight of the single-player equivalent, shape (k, k)."""
        inverse = np.linalg.inv(self.R_eff_inverse)
        return 0.5 * (inverse + inverse.T)

    def single_player(self) -> Game:
        """Return the game of one player with the same value: R = R_eff, γ = infinity."""
        return Game(self.Q, self.R_eff, self.W_d, np.inf)

    def local_cost(self, zeta: Array, u_control: Array, u_disturbance: Array) -> Array:
        """Return r(ζ, u_1, u_2) of (5), sign-indefinite, for rows of states and inputs."""
        cost = _quadratic(zeta, self.Q) + _quadratic(u_control, self.R)
        if np.isfinite(self.gamma):
            cost = cost - self.gamma**2 * _quadratic(u_disturbance, self.W_d)
        return cost

    def policies(self, g: Array, V_zeta: Array) -> tuple[Array, Array]:
        """Return u_1* and u_2* of (8) and (9), each (k,), for g (n, k) and the gradient of V (n,)."""
        push = g.T @ V_zeta
        return -0.5 * self.R_inverse @ push, 0.5 * self.disturbance_inverse @ push

    def players(self, v: Array) -> tuple[Array, Array]:
        """Split v* of the single-player equivalent into (u_1*, u_2*); rows of inputs."""
        weighted = v @ self.R_eff
        return weighted @ self.R_inverse, -weighted @ self.disturbance_inverse

    def hamiltonian(
        self, zeta: Array, f: Array, g: Array, V_zeta: Array, u_1: Array, u_2: Array
    ) -> float:
        """Return H of (6) at one state; zero for the value and the optimal policies (7)."""
        return float(self.local_cost(zeta, u_1, u_2) + V_zeta @ (f + g @ (u_1 + u_2)))

    def stationary_hamiltonian(self, zeta: Array, f: Array, g: Array, V_zeta: Array) -> float:
        """Return ζ'Qζ + V_ζ f - 1/4 V_ζ g R_eff^-1 g'V_ζ', that is H at both optimal policies."""
        push = g.T @ V_zeta
        return float(zeta @ self.Q @ zeta + V_zeta @ f - 0.25 * push @ self.R_eff_inverse @ push)


def _quadratic(x: Array, weight: Array) -> Array:
    return np.asarray(np.sum((x @ weight) * x, axis=-1))
