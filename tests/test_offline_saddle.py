"""The saddle point by Pontryagin's boundary value problem: closed forms, and the direct solution."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest
from casadi import SX
from scipy.integrate import solve_bvp
from stationkeep.offline import DirectSolver, SaddleSolver
from stationkeep.offline.saddle.extremal_field import ExtremalField
from stationkeep.symbolic import Game, InputError, Problem, RunError

from .games import FAR_STATE, FAR_VALUE, FAST_STATE, FAST_VALUE, HALF_WIDTHS, Array, two_state

PLANAR_STATES = np.random.default_rng(3).uniform(-2.0, 2.0, (100, 2))


def closed_form(zeta: Array) -> tuple[float, Array]:
    """V* = ζ_1^2 / 2 + ζ_2^2 and its gradient."""
    return float(zeta[0] ** 2 / 2.0 + zeta[1] ** 2), np.array([zeta[0], 2.0 * zeta[1]])


def scalar_game() -> Problem:
    """V = x^2 + x^4 / 2, which is not quadratic: f follows from (7) with g = 1 and Q = 3."""
    x, game = SX.sym("x"), Game(np.eye(1) * 3.0, np.eye(1), np.eye(1), 2.0)
    slope = 2 * x + 2 * x**3
    drift = 0.25 * (1 - 0.25) * slope - 3 * x / (2 + 2 * x**2)
    return Problem("scalar game", x, drift, SX(1), game, np.ones(1))


@pytest.fixture(scope="module")
def solver(reference_problem: Problem) -> SaddleSolver:
    return SaddleSolver(reference_problem)


def test_two_state_game_has_its_closed_form() -> None:
    """λ(0) = (z1, 2 z2) from 100 states; both players are the policies (8) and (9)."""
    problem, _, _ = two_state()
    saddle = SaddleSolver(problem, compiled=False)
    for zeta in PLANAR_STATES:
        value, gradient = closed_form(zeta)
        solution = saddle.solve(zeta)
        assert solution.value == pytest.approx(value, rel=1e-10)
        np.testing.assert_allclose(solution.costate, gradient, rtol=1e-10, atol=1e-10)
    inner = saddle.rule.times(solution.mesh).ravel()
    for row, (state, costate) in enumerate(zip(*solution.sample(inner), strict=True)):
        g = np.array([[0.0], [np.cos(2.0 * state[0]) + 2.0]])
        control, disturbance = problem.game.policies(g, costate)
        np.testing.assert_allclose(solution.u_control[row], control, atol=1e-12)
        np.testing.assert_allclose(solution.u_disturbance[row], disturbance, atol=1e-12)


@pytest.mark.slow
def test_direct_solution_of_the_two_state_game_has_its_closed_form() -> None:
    direct = DirectSolver(two_state()[0])
    for zeta in PLANAR_STATES:
        value, gradient = closed_form(zeta)
        solution = direct.solve(zeta, verify=False)
        assert solution.value == pytest.approx(value, rel=1e-8)
        np.testing.assert_allclose(solution.costate, gradient, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(("degree", "meshes"), [(1, (16, 32, 64)), (2, (8, 16, 32)), (3, (4, 8, 16))])
def test_value_and_costate_converge_at_the_order_of_gauss(degree: int, meshes: tuple[int, ...]) -> None:
    """2d, against V = x^2 + x^4/2 from x = 1."""
    gaps = []
    for K in meshes:
        saddle = SaddleSolver(
            scalar_game(), horizon=8.0, n_intervals=K, degree=degree, grading=2.0, compiled=False
        )
        solution = saddle.solve(np.ones(1))
        gaps.append([abs(solution.value - 1.5), abs(solution.costate[0] - 4.0)])
    orders = np.polyfit(np.log(meshes), np.log(gaps), 1)[0]
    print(f"degree {degree}: orders of value and costate {-orders}")
    assert np.all(-orders > 2 * degree - 0.5)


def test_linear_quadratic_game(reference_problem: Problem) -> None:
    """The value is ζ'P ζ and the costate 2 P ζ all along; Newton's second step changes nothing."""
    linear = reference_problem.linearized()
    solution, events = SaddleSolver(linear, compiled=False).solve_aligned(FAR_STATE)
    assert solution.value == pytest.approx(FAR_STATE @ linear.P @ FAR_STATE, rel=1e-9)
    expected = 2.0 * solution.states @ linear.P
    np.testing.assert_allclose(solution.costates, expected, atol=1e-9 * np.abs(expected).max())
    assert solution.iterations == 2
    assert len(events) == 0


def test_scipy_finds_the_same_extremal() -> None:
    """scipy's solve_bvp on the equations with the players put in by hand, to its tolerance."""
    problem = scalar_game()
    game, drift = problem.game, problem.drift
    f = casadi.Function("f", [problem.zeta], [drift, casadi.jacobian(drift, problem.zeta)])

    def rate(_: Array, y: Array) -> Array:
        x, costate = y
        drifts, slopes = (np.array(row).ravel() for row in f.map(len(x))(x[None]))
        flow = drifts - 0.5 * (1.0 - 0.25) * costate
        return np.vstack([flow, -2.0 * game.Q[0, 0] * x - slopes * costate])

    def ends(start: Array, end: Array) -> Array:
        return np.array([start[0] - 0.8, end[1] - 2.0 * problem.P[0, 0] * end[0]])

    mesh = np.linspace(0.0, 8.0, 60)
    first = np.vstack([np.exp(-mesh), 2.0 * np.exp(-mesh)])
    expected = solve_bvp(rate, ends, mesh, first, tol=1e-9, max_nodes=20000)
    assert expected.success
    solution = SaddleSolver(problem, horizon=8.0, compiled=False).solve(np.array([0.8]))
    states, costates = solution.sample(mesh)
    np.testing.assert_allclose(states[:, 0], expected.sol(mesh)[0], atol=1e-7)
    np.testing.assert_allclose(costates[:, 0], expected.sol(mesh)[1], atol=1e-7)


@pytest.mark.parametrize(
    ("zeta", "value", "n_events"),
    [(FAR_STATE, FAR_VALUE, 2), (FAST_STATE, FAST_VALUE, 9)],
    ids=["far", "fast"],
)
def test_value_of_the_shipped_game(
    solver: SaddleSolver, zeta: Array, value: float, n_events: int
) -> None:
    """Known to 1e-11 from aligned direct solves; this one finds the sign changes by itself."""
    solution, events = solver.solve_aligned(zeta)
    assert solution.value == pytest.approx(value, rel=1e-10)
    assert len(events) == n_events
    assert np.all(np.isin(events, solution.mesh))
    assert solution.iterations < 40
    game = solver.problem.game
    hamiltonian = game.stationary_hamiltonian(zeta, *solver.plant.terms(zeta), solution.costate)
    assert abs(hamiltonian) < 1e-8 * (zeta @ game.Q @ zeta)


def test_plain_mesh_is_not_aligned(solver: SaddleSolver) -> None:
    """Without its sign changes the mesh costs orders of accuracy: that is what alignment is for."""
    plain, (aligned, _) = solver.solve(FAST_STATE), solver.solve_aligned(FAST_STATE)
    gap = abs(plain.value - FAST_VALUE) / FAST_VALUE
    assert 1e-9 < gap < 1e-5
    assert abs(aligned.value - FAST_VALUE) / FAST_VALUE < 0.01 * gap


@pytest.mark.slow
def test_agrees_with_the_direct_solution_from_the_full_envelope(
    reference_problem: Problem, solver: SaddleSolver
) -> None:
    """Other unknowns, derivatives of the model, collocation and mesh; the same value and costate."""
    direct = DirectSolver(reference_problem)
    for zeta in HALF_WIDTHS * np.random.default_rng(8).uniform(-1.0, 1.0, (12, 12)):
        saddle, _ = solver.solve_aligned(zeta)
        optimum, _ = direct.solve_aligned(zeta)
        gap = abs(saddle.value - optimum.value) / optimum.value
        apart = np.linalg.norm((saddle.costate - optimum.costate) * HALF_WIDTHS)
        apart /= np.linalg.norm(optimum.costate * HALF_WIDTHS)
        print(
            f"value {gap:.1e}, costate {apart:.1e}, {saddle.iterations} steps, {saddle.seconds:.2f} s"
        )
        assert gap < 1e-9
        assert apart < 1e-8


def test_converges_from_the_full_envelope(solver: SaddleSolver) -> None:
    """Also where Newton's method does not from rest, which takes continuation; V > 0 everywhere."""
    states = HALF_WIDTHS * np.random.default_rng(0).uniform(-1.0, 1.0, (20, 12))
    solutions = [solver.solve(zeta) for zeta in states]
    assert all(solution.value > 0.0 for solution in solutions)
    iterations = [solution.iterations for solution in solutions]
    assert np.median(iterations) <= 9
    assert 10 < max(iterations) < 60


def test_single_player_has_the_same_saddle(reference_problem: Problem, solver: SaddleSolver) -> None:
    """With R_eff in place of R and no disturbance: one value, one costate, u_1 + u_2 = v."""
    game = solver.solve(FAR_STATE)
    alone = SaddleSolver(reference_problem.with_game(reference_problem.game.single_player()))
    single = alone.solve(FAR_STATE)
    assert not np.any(single.u_disturbance)
    assert single.slope == 0.0
    assert single.value == pytest.approx(game.value, rel=1e-12)
    np.testing.assert_allclose(single.costate, game.costate, rtol=1e-9, atol=1e-9)
    together = game.u_control + game.u_disturbance
    np.testing.assert_allclose(together, single.u_control, atol=1e-8 * np.abs(together).max())


@pytest.mark.parametrize("gamma", [1.2, 2.0, 5.0])
def test_slope_is_the_derivative_of_the_value_in_gamma(solver: SaddleSolver, gamma: float) -> None:
    """The envelope theorem, -2 γ times the integral of u_2'W_d u_2, against a central difference."""
    step = 1e-4 * gamma
    here = solver.with_gamma(gamma).solve(FAR_STATE)
    ahead, behind = (
        solver.with_gamma(gamma + h).solve(FAR_STATE, start=here).value for h in (step, -step)
    )
    assert here.slope < 0.0
    assert here.slope == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6)


def test_warm_start_saves_steps_and_changes_nothing(solver: SaddleSolver) -> None:
    first = solver.solve(FAR_STATE)
    again = solver.solve(FAR_STATE, start=first)
    assert again.iterations == 1
    assert again.value == pytest.approx(first.value, rel=1e-13)
    near = solver.solve(1.01 * FAR_STATE, start=first)
    assert near.iterations < first.iterations
    assert near.value == pytest.approx(solver.solve(1.01 * FAR_STATE).value, rel=1e-12)
    # a start that leads nowhere is left for the way from rest
    far = solver.solve(
        np.array([-2.0, 1, -1, -0.4, 0.4, -1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5]), start=first
    )
    assert far.value > 0.0


def test_samples_are_the_trajectory(solver: SaddleSolver) -> None:
    solution = solver.solve(FAR_STATE)
    states, costates = solution.sample(solution.times)
    np.testing.assert_allclose(states, solution.states, atol=1e-12)
    np.testing.assert_allclose(costates, solution.costates, atol=1e-9)
    np.testing.assert_array_equal(solution.states[0], FAR_STATE)
    inner = solver.rule.times(solution.mesh).ravel()
    for sampled, known in zip(
        solution.sample_players(inner), (solution.u_control, solution.u_disturbance), strict=True
    ):
        np.testing.assert_allclose(sampled, known, atol=1e-10 * np.abs(known).max())


def test_field_has_its_derivatives(reference_problem: Problem) -> None:
    """Central differences of rate, pull and push in ζ; push and pull of the adjoint by hand."""
    field = ExtremalField(reference_problem, compiled=False)
    rng = np.random.default_rng(4)
    zeta, costate, u = (
        0.5 * HALF_WIDTHS * rng.uniform(0.2, 1.0, 12),
        rng.normal(size=12),
        rng.normal(size=6),
    )
    terms = field(zeta[None], costate[None], u[None])
    h = 1e-6
    rows = zeta + h * np.vstack([np.eye(12), -np.eye(12)])
    around = field(rows, np.tile(costate, (24, 1)), np.tile(u, (24, 1)))

    def difference(values: Array) -> Array:
        return (values[:12] - values[12:]).T / (2.0 * h)

    for derivative, function in (
        (terms.rate_zeta, around.rate),
        (terms.pull_zeta, around.pull),
        (terms.push_zeta, around.push),
    ):
        scale = np.abs(derivative).max()
        np.testing.assert_allclose(derivative[0], difference(function), atol=1e-7 * scale)
    np.testing.assert_allclose(terms.pull[0], terms.rate_zeta[0].T @ costate, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(terms.push[0], terms.g[0].T @ costate, rtol=1e-12)


def test_bad_states_and_lost_continuation(monkeypatch: pytest.MonkeyPatch) -> None:
    saddle = SaddleSolver(two_state()[0], horizon=5.0, n_intervals=4, compiled=False)
    with pytest.raises(InputError, match="finite"):
        saddle.solve(np.array([np.nan, 0.0]))

    def lost(*_: Any) -> tuple[None, int]:
        return None, 1

    monkeypatch.setattr(saddle, "_newton", lost)
    with pytest.raises(RunError, match="no saddle point was found beyond"):
        saddle.solve(np.array([1.0, 1.0]))
