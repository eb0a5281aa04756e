"""The two-player game: its Hamiltonian, its saddle, its single-player equivalent, the closed form."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
import pytest
from numpy.typing import NDArray
from stationkeep.symbolic import Game, GammaTooSmallError, Problem, two_state_game

Array = NDArray[np.float64]


def random_game(seed: int = 0) -> Game:
    """Return a game with full weights, R not proportional to W_d, gamma 1.3 times the threshold."""
    rng = np.random.default_rng(seed)

    def positive(n: int) -> Array:
        factor = rng.standard_normal((n, n))
        return np.asarray(factor @ factor.T + n * np.eye(n))

    Q, R, W_d = positive(12), positive(6), positive(6)
    threshold = np.sqrt(np.linalg.eigvals(np.linalg.inv(W_d) @ R).real.max())
    return Game(Q, R, W_d, 1.3 * threshold)


def point(seed: int = 0) -> tuple[Array, Array, Array, Array]:
    """Return some ζ, f, g and gradient of V."""
    rng = np.random.default_rng(seed)
    return (
        rng.standard_normal(12),
        rng.standard_normal(12),
        rng.standard_normal((12, 6)),
        rng.standard_normal(12),
    )


def test_R_eff_is_the_inverse_of_the_difference() -> None:
    """R_eff (R^-1 - gamma^-2 W_d^-1) = I; one number by hand."""
    game = random_game()
    difference = np.linalg.inv(game.R) - np.linalg.inv(game.W_d) / game.gamma**2
    assert pytest.approx(np.eye(6), abs=1e-12) == game.R_eff @ difference
    assert np.linalg.eigvalsh(game.R_eff).min() > 0.0
    scalar = Game(np.eye(1), np.array([[3.0]]), np.eye(1), 2.0)
    assert scalar.R_eff[0, 0] == pytest.approx(12.0)  # 1 / (1/3 - 1/4)


def test_local_cost_of_rows() -> None:
    """r = ζ'Qζ + u1'R u1 - gamma^2 u2'W_d u2 for one point and for rows of points."""
    game, rng = random_game(), np.random.default_rng(4)
    zeta, u_1, u_2 = (rng.standard_normal((5, n)) for n in (12, 6, 6))
    expected = [
        z @ game.Q @ z + a @ game.R @ a - game.gamma**2 * (b @ game.W_d @ b)
        for z, a, b in zip(zeta, u_1, u_2, strict=True)
    ]
    assert game.local_cost(zeta, u_1, u_2) == pytest.approx(expected)
    assert game.local_cost(zeta[0], u_1[0], u_2[0]) == pytest.approx(expected[0])


def directional(function: Callable[[Array], float], u: Array, direction: Array) -> tuple[float, float]:
    """Return first and second central differences; a quadratic function has no truncation error."""
    ahead, here, behind = function(u + direction), function(u), function(u - direction)
    return (ahead - behind) / 2.0, ahead - 2.0 * here + behind


def test_policies_are_the_saddle_of_the_hamiltonian() -> None:
    """dH/du1 = 0 and dH/du2 = 0 there; H is convex in u1 and concave in u2."""
    for seed in range(5):
        game, (zeta, f, g, V_zeta) = random_game(seed), point(seed)
        u_1, u_2 = game.policies(g, V_zeta)

        def of_control(u: Array) -> float:
            return game.hamiltonian(zeta, f, g, V_zeta, u, u_2)  # noqa: B023

        def of_disturbance(u: Array) -> float:
            return game.hamiltonian(zeta, f, g, V_zeta, u_1, u)  # noqa: B023

        for direction in np.random.default_rng(seed).standard_normal((10, 6)):
            slope, curvature = directional(of_control, u_1, direction)
            assert abs(slope) < 1e-9 * curvature
            assert curvature > 0.0
            slope, curvature = directional(of_disturbance, u_2, direction)
            assert abs(slope) < 1e-9 * -curvature
            assert curvature < 0.0


def test_stationary_hamiltonian_is_H_at_the_policies() -> None:
    """Putting (8) and (9) into (6) leaves - 1/4 V_ζ g R_eff^-1 g'V_ζ'."""
    for seed in range(5):
        game, (zeta, f, g, V_zeta) = random_game(seed), point(seed)
        played = game.hamiltonian(zeta, f, g, V_zeta, *game.policies(g, V_zeta))
        assert game.stationary_hamiltonian(zeta, f, g, V_zeta) == pytest.approx(played, rel=1e-10)


def test_single_player_has_the_same_value() -> None:
    """With R_eff and one player H is the same, v = u1 + u2, and the costs agree at the optimum."""
    for seed in range(5):
        game, (zeta, f, g, V_zeta) = random_game(seed), point(seed)
        alone = game.single_player()
        v, nothing = alone.policies(g, V_zeta)
        u_1, u_2 = game.policies(g, V_zeta)
        assert not nothing.any()
        assert pytest.approx(u_1 + u_2, rel=1e-10) == v
        assert alone.stationary_hamiltonian(zeta, f, g, V_zeta) == pytest.approx(
            game.stationary_hamiltonian(zeta, f, g, V_zeta), rel=1e-10
        )
        assert alone.local_cost(zeta, v, nothing) == pytest.approx(
            game.local_cost(zeta, u_1, u_2), rel=1e-10
        )


def test_players_split_the_single_input() -> None:
    """u1 = R^-1 R_eff v and u2 = -gamma^-2 W_d^-1 R_eff v, for one input and for rows."""
    game = random_game()
    v = np.random.default_rng(3).standard_normal((4, 6))
    u_1, u_2 = game.players(v)
    assert pytest.approx(v, rel=1e-10) == u_1 + u_2
    for row in range(4):
        weighted = game.R_eff @ v[row]
        assert u_1[row] == pytest.approx(np.linalg.solve(game.R, weighted), rel=1e-10)
        expected = -np.linalg.solve(game.W_d, weighted) / game.gamma**2
        assert u_2[row] == pytest.approx(expected, rel=1e-10)
    assert game.players(v[0])[0] == pytest.approx(u_1[0])


def test_without_a_disturbance_player() -> None:
    """gamma = infinity: R_eff = R, u2 = 0, and the cost has no third term."""
    R = np.diag([2.0, 3.0])
    game = Game(np.eye(2), R, np.eye(2), np.inf)
    assert pytest.approx(R) == game.R_eff
    assert not game.policies(np.eye(2), np.ones(2))[1].any()
    assert game.local_cost(np.zeros(2), np.zeros(2), np.ones(2)) == 0.0


def test_weights_can_not_be_changed_afterwards() -> None:
    """A game is a value: neither its arrays nor the caller's array reach into it."""
    Q = np.eye(2)
    game = Game(Q, np.eye(2), np.eye(2), 2.0)
    Q[0, 0] = 7.0
    assert game.Q[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        game.R[0, 0] = 7.0


@pytest.mark.parametrize("gamma", [0.5, 1.0, 2.0])
def test_gamma_below_the_threshold_is_refused(
    gamma: float, one_sentence: Callable[[BaseException], str]
) -> None:
    """R^-1 - gamma^-2 W_d^-1 > 0 is required: with R = 4 and W_d = 1 that is gamma > 2."""
    with pytest.raises(GammaTooSmallError) as caught:
        Game(np.eye(2), 4.0 * np.eye(2), np.eye(2), gamma)
    error = caught.value
    assert error.gamma == gamma
    assert error.threshold == pytest.approx(2.0)
    assert error.gamma_star is None
    text = one_sentence(error)
    assert f"gamma = {gamma:g} is too small" in text
    assert "gamma > sqrt(lambda_max(W_d^-1 R)) = 2" in text
    assert "increase gamma" in text
    Game(np.eye(2), 4.0 * np.eye(2), np.eye(2), 2.001)


def test_the_worst_channel_sets_the_threshold() -> None:
    """sqrt(lambda_max(W_d^-1 R)) with weights that don't commute, from the quadratic formula.

    W_d^-1 R = [[5, -2], [-1, 6]]: lambda^2 - 11 lambda + 28 = 0, so 4 and 7.
    """
    R, W_d = np.array([[9.0, 2.0], [2.0, 16.0]]), np.array([[2.0, 1.0], [1.0, 3.0]])
    assert pytest.approx(np.array([[5.0, -2.0], [-1.0, 6.0]])) == np.linalg.solve(W_d, R)
    threshold = np.sqrt(7.0)
    with pytest.raises(GammaTooSmallError) as caught:
        Game(np.eye(2), R, W_d, 0.999 * threshold)
    assert caught.value.threshold == pytest.approx(threshold, rel=1e-12)
    assert Game(np.eye(2), R, W_d, 1.001 * threshold).gamma == 1.001 * threshold


def test_with_gamma_names_gamma_star(
    reference_problem: Problem, one_sentence: Callable[[BaseException], str]
) -> None:
    """On a vehicle the refusal also says what the linearised game could bear."""
    with pytest.raises(GammaTooSmallError) as caught:
        reference_problem.with_gamma(0.8)
    assert caught.value.gamma == 0.8
    assert caught.value.gamma_star == pytest.approx(1.0, abs=1e-6)
    assert "gamma* of the linearised game is 1)" in one_sentence(caught.value)
    assert reference_problem.with_gamma(1.5).game.gamma == 1.5


@pytest.mark.parametrize(("R", "gamma"), [(1.0, 2.0), (0.3, 0.7), (5.0, 10.0), (1.0, np.inf)])
def test_closed_form_game(R: float, gamma: float) -> None:
    """The residual of (7) is zero for V = ζ_1^2/2 + ζ_2^2, with the plant that errata.md defines."""
    problem = two_state_game(R, gamma)
    terms = casadi.Function("terms", [problem.zeta], [problem.drift, problem.input_matrix])
    k = 1.0 / R - (0.0 if np.isinf(gamma) else gamma**-2)
    for x_1, x_2 in np.random.default_rng(0).uniform(-2.0, 2.0, (200, 2)):
        zeta = np.array([x_1, x_2])
        f, g = (np.array(value) for value in terms(zeta))
        c = np.cos(2.0 * x_1) + 2.0
        assert f.ravel() == pytest.approx([-x_1 + x_2, -x_1 / 2 - x_2 / 2 * (1 - k * c**2)])
        assert g.ravel() == pytest.approx([0.0, c])
        V_zeta = np.array([x_1, 2.0 * x_2])
        size = zeta @ zeta * (1.0 + 9.0 * k)
        policies = problem.game.policies(g, V_zeta)
        assert abs(problem.game.hamiltonian(zeta, f.ravel(), g, V_zeta, *policies)) < 1e-13 * size
        residual = problem.game.stationary_hamiltonian(zeta, f.ravel(), g, V_zeta)
        assert abs(residual) < 1e-13 * size


@pytest.mark.parametrize(("R", "gamma"), [(1.0, 2.0), (0.3, 0.7), (5.0, 10.0)])
def test_closed_form_riccati(R: float, gamma: float) -> None:
    """Its value is quadratic, so the Riccati solution is its Hessian half: diag(1/2, 1)."""
    assert pytest.approx(np.diag([0.5, 1.0]), abs=1e-12) == two_state_game(R, gamma).P
