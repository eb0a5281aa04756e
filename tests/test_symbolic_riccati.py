"""The linearised game: its Riccati solution and the smallest attenuation level gamma*."""

from __future__ import annotations

import signal
from collections.abc import Callable

import casadi
import numpy as np
import pytest
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from stationkeep.symbolic import Game, InputError, Model, Problem, Vehicle, game_riccati, gamma_star

from .fossen import PARAMETERS, SHIPPED

Array = NDArray[np.float64]


@pytest.fixture(params=[*PARAMETERS])
def problem(request: pytest.FixtureRequest, reference_game: Game, reference_scale: Array) -> Problem:
    """The shipped game on each vehicle, the weights scaled to the vehicle's inertia."""
    name = request.param
    vehicle = Vehicle.load(name) if name in SHIPPED else Vehicle(**PARAMETERS[name])
    model = Model(vehicle, current=(0.1, 0.05, -0.02), compiled=False)
    size = np.diag(vehicle.M) / np.diag(Vehicle.load("bluerov2-heavy").M)
    R = np.diag(reference_game.R) / size**2
    return model.problem(Game(reference_game.Q, R, R, 2.0), reference_scale)


def test_P_is_the_single_players(problem: Problem) -> None:
    """The game Riccati solution equals scipy's CARE with R_eff."""
    A, B = problem.linearization
    expected = scipy.linalg.solve_continuous_are(A, B, problem.game.Q, problem.game.R_eff)
    assert np.linalg.norm(problem.P - expected) < 1e-9 * np.linalg.norm(expected)


def test_P_solves_the_equation_of_both_players(problem: Problem) -> None:
    """A'P + PA + Q - PB R^-1 B'P + gamma^-2 PB W_d^-1 B'P = 0; P > 0; the saddle is stable."""
    (A, B), P, game = problem.linearization, problem.P, problem.game
    control = np.linalg.solve(game.R, B.T @ P)
    disturbance = np.linalg.solve(game.W_d, B.T @ P) / game.gamma**2
    terms = [A.T @ P, P @ A, game.Q, -P @ B @ control, P @ B @ disturbance]
    assert np.linalg.norm(sum(terms)) < 1e-11 * max(np.linalg.norm(term) for term in terms)
    assert np.linalg.eigvalsh(P).min() > 0.0
    assert np.linalg.eigvals(A - B @ control + B @ disturbance).real.max() < 0.0
    assert np.linalg.eigvals(A - B @ control).real.max() < 0.0


def test_linearization_is_the_derivative(problem: Problem) -> None:
    """A by central differences of f, B = g(0).

    A quadratic drag |p| p leaves an error proportional to the step: two steps take it out.
    """
    A, B = problem.linearization
    f = casadi.Function("f", [problem.zeta], [problem.drift])

    def difference(h: float) -> Array:
        columns = [np.array(f(h * e) - f(-h * e)).ravel() / (2 * h) for e in np.eye(12)]
        return np.column_stack(columns)

    estimate = 2.0 * difference(0.5e-4) - difference(1e-4)
    assert np.linalg.norm(estimate - A) < 1e-7 * np.linalg.norm(A)
    g = casadi.Function("g", [problem.zeta], [problem.input_matrix])
    assert np.array_equal(np.array(g(np.zeros(12))), B)


def test_linearized_problem_is_linear(problem: Problem) -> None:
    """Its f is A ζ everywhere and its g is B; it keeps A, B and so P."""
    linear = problem.linearized()
    A, B = problem.linearization
    terms = casadi.Function("terms", [linear.zeta], [linear.drift, linear.input_matrix])
    for zeta in np.random.default_rng(0).uniform(-1.0, 1.0, (20, 12)):
        f, g = terms(zeta)
        assert np.array(f).ravel() == pytest.approx(A @ zeta, rel=1e-12, abs=1e-12)
        assert np.array_equal(np.array(g), B)
    assert np.linalg.norm(linear.P - problem.P) <= 1e-12 * np.linalg.norm(problem.P)


def test_gamma_star_of_the_shipped_game(reference_problem: Problem, reference_game: Game) -> None:
    """Undamped axes need R_eff > 0 itself: 1 with W_d = R, sqrt(10) with W_d = I."""
    assert reference_problem.gamma_star == pytest.approx(1.0, abs=1e-6)
    Q, R = reference_game.Q, reference_game.R
    paper = reference_problem.with_game(Game(Q, R, np.eye(6), 4.0))
    assert paper.gamma_star == pytest.approx(np.sqrt(10.0), abs=1e-6)


def test_gamma_star_of_one_damped_state() -> None:
    """x_dot = -a x + u1 + u2: 2aP + (1/R - 1/gamma^2) P^2 = q has a root for gamma^-2 <= 1/R + a^2/q.

    With a = 1, q = 3, R = 1: gamma*^2 = 3/4, below the threshold gamma^2 > 1 of R_eff > 0.
    """
    one = np.eye(1)
    assert gamma_star(-one, one, 3 * one, one, one) == pytest.approx(np.sqrt(0.75), abs=1e-8)


def damped_game() -> tuple[Array, Array, Array]:
    """Return A, B and Q of two coupled, damped oscillators that are pushed at the masses."""
    stiffness = np.array([[3.0, -1.0], [-1.0, 2.0]])
    dampers = np.array([[1.1, -0.3], [-0.3, 0.8]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -dampers]])
    B = np.vstack([np.zeros((2, 2)), [[1.0, 0.2], [0.0, 0.7]]])
    return A, B, np.diag([1.0, 2.0, 0.5, 0.3])


def test_gamma_star_from_the_frequency_response() -> None:
    """With R = rho W_d only one number counts: gamma*^-2 = 1/rho + 1/h^2.

    h = max over w of the gain of Q^(1/2) (jw - A)^-1 B W_d^(-1/2): below the threshold u1 is outplayed,
    and the net player of weight (gamma^-2 - 1/rho) W_d^-1 must keep the small gain (bounded real).
    """
    A, B, Q = damped_game()
    W_d, rho = np.diag([2.0, 0.5]), 4.0

    def gain(frequency: float) -> float:
        response = np.linalg.solve(1j * frequency * np.eye(4) - A, B) / np.sqrt(np.diag(W_d))
        return float(np.linalg.norm(np.sqrt(Q) @ response, 2))

    grid = np.linspace(0.0, 10.0, 2001)
    best = grid[np.argmax([gain(w) for w in grid])]
    bounds = (max(best - 0.01, 0.0), best + 0.01)
    h = -minimize_scalar(lambda w: -gain(w), bounds=bounds, method="bounded").fun
    expected = (1.0 / rho + h**-2) ** -0.5
    assert expected < 0.95 * np.sqrt(rho)  # the threshold of R_eff > 0 does not decide
    assert gamma_star(A, B, Q, rho * W_d, W_d) == pytest.approx(expected, rel=1e-6)


def test_gamma_star_from_the_hamiltonian_matrix() -> None:
    """R and W_d not proportional: at gamma* the Hamiltonian's eigenvalues reach the imaginary axis.

    And just above it the Riccati differential equation from P = 0 settles, where just below it escapes
    (Basar and Bernhard 1995, theorem 4.8), which needs no eigenvalues at all.
    """
    A, B, Q = damped_game()
    R, W_d = np.array([[1.0, 0.3], [0.3, 4.0]]), np.array([[1.5, -0.2], [-0.2, 1.0]])
    threshold = np.sqrt(np.linalg.eigvals(np.linalg.solve(W_d, R)).real.max())

    def hamiltonian(gamma: float) -> Array:
        inverse = np.linalg.inv(R) - np.linalg.inv(W_d) / gamma**2
        return np.block([[A, -B @ inverse @ B.T], [-Q, -A.T]])

    def distance(gamma: float) -> float:
        return float(np.abs(np.linalg.eigvals(hamiltonian(gamma)).real).min())

    above, below = threshold, 0.05 * threshold
    assert distance(below) < 1e-9 < distance(above)
    for _ in range(40):
        middle = 0.5 * (above + below)
        above, below = (middle, below) if distance(middle) > 1e-6 else (above, middle)
    star = gamma_star(A, B, Q, R, W_d)
    assert star < 0.95 * threshold
    assert star == pytest.approx(above, rel=1e-4)
    assert settles(hamiltonian(1.001 * star))
    assert not settles(hamiltonian(0.999 * star))


def settles(hamiltonian: Array, duration: float = 400.0, step: float = 0.01) -> bool:
    """Return whether P_dot = A'P + PA - PSP + Q from P = 0 stays positive over the duration.

    Exact steps: [X; Y] propagates with exp(-H t) from [I; P], and P = Y X^-1; an escape to infinity
    shows as det X <= 0.
    """
    n = hamiltonian.shape[0] // 2
    flow = scipy.linalg.expm(-hamiltonian * step)
    P = np.zeros((n, n))
    for _ in range(round(duration / step)):
        stacked = flow @ np.vstack([np.eye(n), P])
        if np.linalg.det(stacked[:n]) <= 0.0:
            return False
        P = np.linalg.solve(stacked[:n].T, stacked[n:].T).T
        P = 0.5 * (P + P.T)
    return True


def test_unreachable_unstable_mode_is_refused(one_sentence: Callable[[BaseException], str]) -> None:
    """Nothing pushes the first state, which grows."""
    A, B = np.diag([1.0, -1.0]), np.array([[0.0], [1.0]])
    game = Game(np.eye(2), np.eye(1), np.eye(1), 2.0)
    for attempt in (
        lambda: game_riccati(A, B, game),
        lambda: gamma_star(A, B, game.Q, game.R, game.W_d),
    ):
        with pytest.raises(InputError, match="can't be stabilised") as caught:
            attempt()
        assert "1/s" in one_sentence(caught.value)


@pytest.mark.skipif(
    not hasattr(signal, "setitimer"), reason="there is no timer to end an endless search"
)
def test_no_gamma_at_all_is_refused(one_sentence: Callable[[BaseException], str]) -> None:
    """An undamped mode that Q does not see stays on the imaginary axis at every gamma."""

    def too_long(*_: object) -> None:
        raise TimeoutError("gamma_star does not end")

    A, B = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0], [1.0]])
    previous = signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, 5.0)
    try:
        with pytest.raises(InputError) as caught:
            gamma_star(A, B, np.zeros((2, 2)), np.eye(1), np.eye(1))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
    one_sentence(caught.value)
