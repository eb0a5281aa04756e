"""The linearised game: its stabilising Riccati solution and the smallest attenuation level γ*.

    A'P + P A - P B (R^-1 - γ^-2 W_d^-1) B'P + Q = 0,   A - B R_eff^-1 B'P stable

P = X_2 X_1^-1 from the stable eigenspace [X_1; X_2] of the Hamiltonian matrix
[[A, -B R_eff^-1 B'], [-Q, -A']]; it exists when no eigenvalue lies on the imaginary axis and X_1 is
invertible, and it is the game's when P is positive semidefinite (Basar and Bernhard 1995, ch. 4).

Which of these fails first as γ falls decides γ*. With G = (jω - A)^-1 B and Φ(ω) = G^*Q G, jω is an
eigenvalue where det(I + Φ (R^-1 - γ^-2 W_d^-1)) = 0, that is where γ^2 is an eigenvalue of
W_d^-1 (R - R (R + Φ)^-1 R). The largest of these falls continuously to 0 as ω grows, so the γ with
eigenvalues on the axis are an interval (0, γ_H]; γ_H <= γ*, and neither exceeds the threshold of
R_eff > 0. They are equal if A is stable and R_eff^-1 is semidefinite down to γ_H, as with one input
or W_d proportional to R: with S = B R_eff^-1 B', X_1 x = 0 gives x'X_2'S X_2 x = 0, so S X_2 x = 0, so
the kernel of X_1 is invariant and A' has an unstable eigenvalue in it. With A unstable, or R_eff^-1
indefinite, X_1 may become singular before: P escapes, a conjugate point at infinity, and γ_H < γ*.
"""

from __future__ import annotations

import numpy as np
import scipy

from ..arrays import Array
from ..errors import GammaTooSmallError, InputError
from .game import Game, gamma_threshold


def stabilising_solution(A: Array, B: Array, Q: Array, R_eff_inverse: Array) -> Array | None:
    """Return P from the stable eigenspace, shape (n, n), or None where there is none.

    `R_eff_inverse` may be indefinite: nothing is inverted but X_1.
    """
    n = A.shape[0]
    S = B @ R_eff_inverse @ B.T
    hamiltonian = np.block([[A, -S], [-Q, -A.T]])
    eigenvalues = scipy.linalg.eigvals(hamiltonian)
    scale = np.abs(eigenvalues).max()
    if np.abs(eigenvalues.real).min() <= 1e-10 * scale:
        return None
    _, basis, n_stable = scipy.linalg.schur(hamiltonian, sort="lhp")
    X_1, X_2 = basis[:n, :n], basis[n:, :n]
    if n_stable != n or np.linalg.cond(X_1) > 1e14:
        return None
    P = np.linalg.solve(X_1.T, X_2.T).T
    P = 0.5 * (P + P.T)
    if np.linalg.eigvalsh(P).min() < -1e-9 * np.abs(P).max():
        return None
    return np.asarray(P, dtype=np.float64)


def game_riccati(A: Array, B: Array, game: Game) -> Array:
    """Return the stabilising solution P of the game Riccati equation, shape (n, n).

    V = ζ'P ζ is the value of the linearised game. The eigenspace solution is polished by one Newton
    step (a Lyapunov equation), which brings the residual to rounding.

    Raises
    ------
    GammaTooSmallError
        If γ does not exceed γ*.
    """
    P = stabilising_solution(A, B, game.Q, game.R_eff_inverse)
    if P is None:
        _require_stabilisable(A, B)
        star = gamma_star(A, B, game.Q, game.R, game.W_d)
        raise GammaTooSmallError(game.gamma, gamma_threshold(game.R, game.W_d), star)
    S = B @ game.R_eff_inverse @ B.T
    closed = A - S @ P
    polished = scipy.linalg.solve_continuous_lyapunov(closed.T, -(game.Q + P @ S @ P))
    return np.asarray(0.5 * (polished + polished.T), dtype=np.float64)


def gamma_derivative(A: Array, B: Array, game: Game, P: Array) -> Array:
    """Return dP/dγ of the game Riccati solution, shape (n, n).

    The envelope theorem: -2 γ times the integral of u_2'W_d u_2 on the saddle of the linear game, that
    is (A - B R_eff^-1 B'P)'X + X (A - B R_eff^-1 B'P) = 2 γ^-3 P B W_d^-1 B'P.
    """
    push = B.T @ P
    closed = A - B @ game.R_eff_inverse @ push
    right = 2.0 * float(game.gamma) ** -3 * push.T @ np.linalg.solve(game.W_d, push)
    return np.asarray(scipy.linalg.solve_continuous_lyapunov(closed.T, right), dtype=np.float64)


def gamma_star(A: Array, B: Array, Q: Array, R: Array, W_d: Array, tolerance: float = 1e-9) -> float:
    """Return γ*, the infimum of γ for which the game Riccati equation is solved, by bisection [-].

    `tolerance` is the relative width of the final bracket.
    """
    _require_stabilisable(A, B)
    R_inverse, W_inverse = np.linalg.inv(R), np.linalg.inv(W_d)

    def solvable(gamma: float) -> bool:
        P = stabilising_solution(A, B, Q, R_inverse - gamma**-2 * W_inverse)
        return P is not None

    upper = 2.0 * gamma_threshold(R, W_d)
    while not solvable(upper):
        upper *= 2.0
        if upper > 1e12 * gamma_threshold(R, W_d):
            raise InputError(
                "the linearised game has no stabilising solution at any gamma; Q must see every mode "
                "that is not damped, and the weights must not differ by many powers of ten"
            )
    lower = 0.0
    while upper - lower > tolerance * upper:
        middle = 0.5 * (lower + upper)
        if solvable(middle):
            upper = middle
        else:
            lower = middle
    return upper


def gamma_hamiltonian(
    A: Array, B: Array, Q: Array, R: Array, W_d: Array, tolerance: float = 1e-9
) -> float:
    """Return γ_H, above which the Hamiltonian matrix has no eigenvalue on the imaginary axis [-].

    A route to γ* that needs no Riccati solution: γ_H = γ* if A is stable and R_eff^-1 semidefinite at
    γ_H, and a lower bound otherwise; see above. `tolerance` is the relative width of the final bracket.
    """
    _require_stabilisable(A, B)
    R_inverse, W_inverse = np.linalg.inv(R), np.linalg.inv(W_d)
    lower, upper = 0.0, gamma_threshold(R, W_d)
    while upper - lower > tolerance * upper:
        middle = 0.5 * (lower + upper)
        S = B @ (R_inverse - middle**-2 * W_inverse) @ B.T
        eigenvalues = scipy.linalg.eigvals(np.block([[A, -S], [-Q, -A.T]]))
        # two that meet on the axis part like a square root: 1e-8 is rounding
        if np.abs(eigenvalues.real).min() > 1e-8 * np.abs(eigenvalues).max():
            upper = middle
        else:
            lower = middle
    return upper


def _require_stabilisable(A: Array, B: Array) -> None:
    for eigenvalue in np.linalg.eigvals(A):
        if eigenvalue.real >= -1e-12:
            pencil = np.hstack([A - eigenvalue * np.eye(A.shape[0]), B])
            singular = np.linalg.svd(pencil, compute_uv=False)
            if singular[-1] < 1e-10 * singular[0]:
                raise InputError(
                    f"the linearised plant can't be stabilised: its mode at {eigenvalue:.4g} 1/s is "
                    "not reached by any input"
                )
