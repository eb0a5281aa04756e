"""gamma* by two routes, Riccati solution and Hamiltonian eigenvalues, and which of them decides."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar
from stationkeep.symbolic import Game, Problem, game_riccati, gamma_hamiltonian, gamma_star
from stationkeep.symbolic.game import gamma_threshold

from .games import Array
from .test_symbolic_riccati import settles

Matrices = tuple[Array, Array, Array, Array, Array]
FREQUENCIES = np.concatenate([[0.0], np.logspace(-3.0, 3.0, 1201)])


def chain(n: int, ratio: float) -> Matrices:
    """Return A, B, Q, R, W_d of n damped masses between springs, both players pushing every mass."""
    links = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-3.0 * links, -0.4 * links]])
    B = np.vstack([np.zeros((n, n)), np.eye(n)])
    W_d = np.diag(np.linspace(1.0, 2.0, n))
    return A, B, np.eye(2 * n), ratio * W_d, W_d


def crossing(A: Array, B: Array, Q: Array) -> Matrices:
    """Return weights of which neither outweighs the other: R_eff^-1 is indefinite near γ*."""
    return A, B, Q, np.diag([1.0, 6.0]), np.eye(2)


ESCAPING = crossing(
    np.array([[-1.0, 3.0], [0.0, -1.0]]),
    np.array([[-2.0, -1.0], [2.0, 0.0]]),
    np.diag([8.0, 1.0]),
)


def hamiltonian(A: Array, B: Array, Q: Array, R: Array, W_d: Array, gamma: float) -> Array:
    S = B @ (np.linalg.inv(R) - np.linalg.inv(W_d) / gamma**2) @ B.T
    return np.block([[A, -S], [-Q, -A.T]])


def peak(function: Callable[[float], float]) -> float:
    """Return the maximum over frequencies [1/s], refined between those of the grid."""
    i = int(np.argmax([function(w) for w in FREQUENCIES]))
    bounds = FREQUENCIES[max(i - 1, 0)], FREQUENCIES[min(i + 1, len(FREQUENCIES) - 1)]
    found = minimize_scalar(
        lambda w: -function(w), bounds=bounds, method="bounded", options={"xatol": 1e-9}
    )
    return max(-float(found.fun), function(float(FREQUENCIES[i])))


def frequency_level(A: Array, B: Array, Q: Array, R: Array, W_d: Array) -> float:
    """Return max over w of sqrt λ_max(W_d^-1 (R - R (R + Φ)^-1 R)), Φ = G^*Q G, G = (jw - A)^-1 B."""
    root = scipy.linalg.sqrtm(np.linalg.inv(W_d)).real

    def level(frequency: float) -> float:
        G = np.linalg.solve(1j * frequency * np.eye(len(A)) - A, B)
        parallel = R - R @ np.linalg.solve(R + G.conj().T @ Q @ G, R)
        return float(np.sqrt(np.linalg.eigvalsh(root @ parallel @ root).max()))

    return peak(level)


def gain(A: Array, B: Array, Q: Array, R: Array, W_d: Array, K: Array) -> float:
    """Return the H-infinity norm from W_d^(1/2) u2 to (Q^(1/2) ζ, R^(1/2) u1) under u1 = -K ζ."""
    weight = np.linalg.inv(np.linalg.cholesky(W_d)).T
    output = np.vstack([np.linalg.cholesky(Q).T, np.linalg.cholesky(R).T @ K])
    closed = A - B @ K
    assert np.linalg.eigvals(closed).real.max() < 0.0
    eye = np.eye(len(A))

    def response(frequency: float) -> float:
        states = np.linalg.solve(1j * frequency * eye - closed, B @ weight)
        return float(np.linalg.norm(output @ states, 2))

    return peak(response)


@pytest.mark.parametrize("ratio", [1.0, 4.0, 30.0])
@pytest.mark.parametrize("n", [1, 3])
def test_damped_chain_by_two_routes_and_the_frequency_response(n: int, ratio: float) -> None:
    """A stable and W_d proportional to R: the eigenvalues decide, not R_eff > 0."""
    matrices = chain(n, ratio)
    by_riccati, by_eigenvalues = gamma_star(*matrices), gamma_hamiltonian(*matrices)
    assert by_riccati < 0.98 * gamma_threshold(*matrices[3:])
    assert by_eigenvalues == pytest.approx(by_riccati, rel=1e-6)
    assert frequency_level(*matrices) == pytest.approx(by_riccati, rel=1e-6)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_routes_agree_for_one_input(seed: int) -> None:
    """Random stable plants of one input, where R_eff has one sign."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + rng.uniform(0.1, 1.0)) * np.eye(n)
    root = rng.standard_normal((n, n))
    weights = root @ root.T + 0.1 * np.eye(n), *rng.uniform(0.3, 3.0, (2, 1, 1))
    matrices = A, rng.standard_normal((n, 1)), *weights
    assert gamma_hamiltonian(*matrices) == pytest.approx(gamma_star(*matrices), rel=1e-5)


@pytest.mark.parametrize(("paper", "expected"), [(False, 1.0), (True, np.sqrt(10.0))])
def test_shipped_game_by_two_routes(reference_problem: Problem, paper: bool, expected: float) -> None:
    """Undamped axes: both criteria fail at the threshold itself, 1 with W_d = R, sqrt(10) with I."""
    (A, B), game = reference_problem.linearization, reference_problem.game
    matrices = A, B, game.Q, game.R, np.eye(6) if paper else game.R
    assert gamma_star(*matrices) == pytest.approx(expected, abs=1e-6)
    assert gamma_hamiltonian(*matrices) == pytest.approx(expected, abs=1e-6)


def test_unstable_plant_needs_the_control_to_win() -> None:
    """x_dot = x + u1 + u2, R = W_d = 1: P exists only if R_eff > 0, so γ* = 1.

    The eigenvalues ±sqrt(1 + q (1 - γ^-2)) leave the axis already at γ_H = (1 + 1/q)^(-1/2).
    """
    one = np.eye(1)
    assert gamma_star(one, one, 3 * one, one, one) == pytest.approx(1.0, abs=1e-8)
    expected = (1.0 + 1.0 / 3.0) ** -0.5
    assert gamma_hamiltonian(one, one, 3 * one, one, one) == pytest.approx(expected, abs=1e-8)


def test_indefinite_weights_may_fail_before_the_eigenvalues() -> None:
    """A stable, R_eff^-1 indefinite: between γ_H and γ* no eigenvalue is on the axis, yet P escapes.

    The Riccati differential equation from P = 0 says so without eigenvalues or bisection.
    """
    level, star = gamma_hamiltonian(*ESCAPING), gamma_star(*ESCAPING)
    assert level == pytest.approx(frequency_level(*ESCAPING), rel=1e-6)
    assert level == pytest.approx(1.0307, abs=1e-4)
    assert star == pytest.approx(1.1820, abs=1e-4)
    between = np.linalg.eigvals(hamiltonian(*ESCAPING, 0.5 * (level + star)))
    assert np.abs(between.real).min() > 0.1
    assert not settles(hamiltonian(*ESCAPING, 0.5 * (level + star)))
    assert not settles(hamiltonian(*ESCAPING, 0.999 * star))
    assert settles(hamiltonian(*ESCAPING, 1.001 * star))


@pytest.mark.parametrize("matrices", [chain(2, 30.0), ESCAPING], ids=["chain", "escaping"])
def test_no_state_feedback_attenuates_below_gamma_star(matrices: Matrices) -> None:
    """The full-information H-infinity problem: R^-1 B'P just above γ* attains it, none goes below."""
    A, B, Q, R, W_d = matrices
    star = gamma_star(*matrices)
    S = B @ (np.linalg.inv(R) - np.linalg.inv(W_d) / (1.001 * star) ** 2) @ B.T
    n = len(A)
    # the stable eigenspace again, by sorting eigenvectors
    values, vectors = np.linalg.eig(np.block([[A, -S], [-Q, -A.T]]))
    stable = vectors[:, values.real < 0.0]
    P = np.linalg.solve(stable[:n].T, stable[n:].T).T.real
    central = np.linalg.solve(R, B.T @ P)
    assert gain(*matrices, central) < 1.001 * star
    rng = np.random.default_rng(6)
    for size in np.logspace(-3.0, 0.0, 40):
        K = central + size * np.abs(central).max() * rng.standard_normal(central.shape)
        if np.linalg.eigvals(A - B @ K).real.max() < -1e-3:
            assert gain(*matrices, K) > star


def test_derivative_of_P_in_gamma(reference_problem: Problem) -> None:
    """Against a central difference of the Riccati solution; V falls as γ grows, so dP/dγ <= 0."""
    (A, B), game = reference_problem.linearization, reference_problem.game
    h = 1e-4
    ahead, behind = (
        game_riccati(A, B, Game(game.Q, game.R, game.W_d, game.gamma + s)) for s in (h, -h)
    )
    slope = reference_problem.P_gamma
    assert np.abs((ahead - behind) / (2.0 * h) - slope).max() < 1e-7 * np.abs(slope).max()
    assert np.linalg.eigvalsh(slope).max() <= 1e-12 * np.abs(slope).max()
    alone = reference_problem.with_gamma(np.inf)
    assert not np.any(alone.P_gamma)
