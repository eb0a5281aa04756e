"""Radau collocation: the rule itself, and its order on games whose value is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from stationkeep.offline import DirectSolution, DirectSolver, Trajectory
from stationkeep.offline.direct import Transcription
from stationkeep.offline.direct.stage import single_player
from stationkeep.offline.path import RadauRule
from stationkeep.symbolic import Problem

from .games import FAR_STATE, HALF_WIDTHS, Array, linear_quadratic, two_state

DEGREES = range(1, 10)
PLANAR_STATE = np.array([1.0, -0.7])


@pytest.mark.parametrize("degree", DEGREES)
def test_quadrature_is_exact_to_its_degree(degree: int) -> None:
    """d Radau points integrate polynomials of degree 2d - 2 exactly, and not of degree 2d - 1."""
    rule = RadauRule(degree)
    _, weights = rule.coefficients
    assert rule.nodes[-1] == 1.0
    for power in range(2 * degree - 1):
        assert weights @ rule.nodes**power == pytest.approx(1.0 / (power + 1), abs=1e-10)
    missed = weights @ rule.nodes ** (2 * degree - 1) - 1.0 / (2 * degree)
    assert abs(missed) > 1e-11


@pytest.mark.parametrize("degree", DEGREES)
def test_differentiation_is_exact_to_its_degree(degree: int) -> None:
    rule = RadauRule(degree)
    derivative, _ = rule.coefficients
    points = np.append(0.0, rule.nodes)
    for power in range(degree + 1):
        slopes = power * rule.nodes ** max(power - 1, 0)
        np.testing.assert_allclose(points**power @ derivative, slopes, atol=1e-9 * (1 + degree**2))


@pytest.mark.parametrize("degree", DEGREES)
def test_nodes_are_the_radau_points(degree: int) -> None:
    """Roots of P_d - P_{d-1}, mapped from (-1, 1] to (0, 1] (Kameswaran and Biegler 2008)."""
    legendre = np.polynomial.legendre
    minus, plus = np.zeros(degree + 1), np.zeros(degree + 1)
    plus[degree], minus[degree - 1] = 1.0, 1.0
    roots = np.sort(legendre.legroots(plus - minus))
    np.testing.assert_allclose(RadauRule(degree).nodes, (roots + 1.0) / 2.0, atol=1e-9)


def closed_form(zeta: Array) -> tuple[float, Array]:
    """V* = ζ_1^2 / 2 + ζ_2^2 and its gradient."""
    return float(zeta[0] ** 2 / 2.0 + zeta[1] ** 2), np.array([zeta[0], 2.0 * zeta[1]])


def mesh_errors(
    problem: Problem,
    zeta0: Array,
    exact: tuple[float, Array],
    degree: int,
    meshes: Sequence[int],
    horizon: float,
    grading: float,
) -> tuple[Array, Array]:
    """Return the relative errors of value and costate on each mesh."""
    value, gradient = exact
    unit = problem.scale
    errors = []
    for K in meshes:
        solver = DirectSolver(problem, horizon=horizon, n_intervals=K, degree=degree, grading=grading)
        answer = solver.solve(zeta0, verify=False)
        gap = np.linalg.norm((answer.costate - gradient) * unit)
        errors.append([abs(answer.value - value) / value, gap / np.linalg.norm(gradient * unit)])
    in_value, in_costate = np.array(errors).T
    return in_value, in_costate


def order(errors: Array, meshes: Sequence[int]) -> float:
    """Return minus the slope of log(error) over log(K)."""
    return -float(np.polyfit(np.log(meshes), np.log(errors), 1)[0])


# The optimality conditions of the transcription are the partitioned Runge-Kutta pair Radau IIA (states)
# and Radau IA (costates), of order 2d - 1 at the mesh points; the value is a quadrature along it of the
# same order, and its derivative, the costate at 0, too (Hager 2000; Kameswaran and Biegler 2008).
@pytest.mark.parametrize("grading", [0.0, 3.0])
@pytest.mark.parametrize(
    ("degree", "meshes"),
    [(1, (64, 128, 256, 512)), (2, (16, 32, 64, 128)), (3, (16, 32, 64)), (4, (24, 34, 48))],
)
def test_order_on_the_two_state_game(degree: int, meshes: tuple[int, ...], grading: float) -> None:
    problem, _, _ = two_state()
    exact = closed_form(PLANAR_STATE)
    errors = mesh_errors(problem, PLANAR_STATE, exact, degree, meshes, 4.0, grading)
    orders = [order(error, meshes) for error in errors]
    print(f"two-state d={degree} grading={grading}: orders {orders}, errors {errors}")
    assert min(orders) >= 2 * degree - 1 - 0.5
    assert max(orders) <= 2 * degree - 1 + 2.0
    assert errors[0][-1] < errors[0][0] / 2 ** (2 * degree - 2)


@pytest.mark.parametrize(
    ("degree", "meshes", "grading"),
    [(2, (32, 64, 128), 0.0), (2, (16, 32, 64), 2.0), (3, (16, 32, 64), 2.0), (4, (8, 16, 32), 2.0)],
)
def test_order_on_the_linear_game(degree: int, meshes: tuple[int, ...], grading: float) -> None:
    problem, _, _ = linear_quadratic()
    exact = float(FAR_STATE @ problem.P @ FAR_STATE), 2.0 * problem.P @ FAR_STATE
    errors = mesh_errors(problem, FAR_STATE, exact, degree, meshes, 8.0, grading)
    orders = [order(error, meshes) for error in errors]
    print(f"linear d={degree} grading={grading}: orders {orders}, errors {errors}")
    assert min(orders) >= 2 * degree - 1 - 0.5
    assert max(orders) <= 2 * degree - 1 + 1.0


@pytest.mark.parametrize("zeta0", [(1.0, -0.7), (-1.5, 1.2), (0.3, 2.0)])
@pytest.mark.parametrize("horizon", [3.0, 12.0])
def test_two_state_value_costate_and_policies(zeta0: tuple[float, float], horizon: float) -> None:
    """The rest ζ(T)'P ζ(T) is the exact value there, so any horizon gives the whole of it."""
    problem, _, _ = two_state()
    start = np.array(zeta0)
    solver = DirectSolver(problem, horizon=horizon, n_intervals=40, degree=5, grading=2.0)
    answer = solver.solve(start)
    value, gradient = closed_form(start)
    assert answer.value == pytest.approx(value, rel=1e-8)
    np.testing.assert_allclose(answer.costate, gradient, atol=1e-7)
    # (8), (9) with R = 1, γ = 2 and g = (0, c)
    c = np.cos(2.0 * start[0]) + 2.0
    assert answer.u_control[0] == pytest.approx(-c * start[1], abs=1e-7)
    assert answer.u_disturbance[0] == pytest.approx(c * start[1] / 4.0, abs=1e-7)
    assert answer.hji_residual < 1e-7
    assert answer.defect < 1e-6
    assert answer.reintegrated_value == pytest.approx(value, rel=1e-7)


def test_linear_value_is_the_riccati_solution() -> None:
    problem, _, _ = linear_quadratic()
    solver = DirectSolver(problem, horizon=20.0, n_intervals=30, degree=5, grading=3.0)
    rng = np.random.default_rng(0)
    for zeta0 in (FAR_STATE, HALF_WIDTHS * rng.uniform(-1.0, 1.0, 12)):
        answer = solver.solve(zeta0)
        assert answer.value == pytest.approx(zeta0 @ problem.P @ zeta0, rel=1e-9)
        np.testing.assert_allclose(
            answer.costate * HALF_WIDTHS, 2.0 * problem.P @ zeta0 * HALF_WIDTHS, atol=1e-5
        )
        assert answer.reintegrated_value == pytest.approx(answer.value, rel=1e-7)
        u_control, u_disturbance = solver.plant.linear_policy(zeta0), answer.u_disturbance
        np.testing.assert_allclose(answer.u_control + u_disturbance, u_control, atol=1e-5)


def trajectory() -> tuple[Problem, DirectSolution]:
    problem, _, _ = two_state()
    solver = DirectSolver(problem, horizon=6.0, n_intervals=20, degree=4, grading=2.0)
    return problem, solver.solve(PLANAR_STATE)


def test_trajectory_is_the_optimal_closed_loop() -> None:
    """Against scipy on ζ_dot = f + g v*, with the closed form's v*, between the points too."""
    problem, answer = trajectory()
    plant, path = DirectSolver(problem).plant, answer.trajectory

    def rate(t: float, zeta: Array) -> Array:
        _, g = plant.terms(zeta)
        push = g.T @ closed_form(zeta)[1]
        return plant.rate(zeta, -0.5 * problem.game.R_eff_inverse @ push)

    times = np.linspace(0.0, path.mesh[-1], 101)
    reference = solve_ivp(
        rate, (0.0, times[-1]), PLANAR_STATE, "DOP853", t_eval=times, rtol=1e-10, atol=1e-12
    )
    states, v = path.sample(times)
    np.testing.assert_allclose(states, reference.y.T, atol=2e-5)
    np.testing.assert_array_equal(states[0], PLANAR_STATE)
    expected = [-0.5 * 0.75 * (np.cos(2 * a) + 2.0) * 2.0 * b for a, b in reference.y.T[1:]]
    np.testing.assert_allclose(v[1:, 0], expected, atol=1e-3)


def test_trajectory_polynomials_pass_through_their_points() -> None:
    _, answer = trajectory()
    path = answer.trajectory
    states, v = path.sample(path.times)
    np.testing.assert_allclose(states, path.states, atol=1e-12)
    inner = ~np.isin(path.times[1:], path.mesh)
    np.testing.assert_allclose(v[1:][inner], path.v[inner], atol=1e-9)
    np.testing.assert_array_equal(path.at_mesh(), path.states[:: path.degree])
    np.testing.assert_allclose(path.times[:: path.degree], path.mesh, atol=1e-12)
    beyond_states, beyond_v = path.sample(np.array([6.5, 100.0]))
    assert not np.any(beyond_states)
    assert not np.any(beyond_v)


def test_players_of_a_trajectory_sum_to_its_input() -> None:
    problem, answer = trajectory()
    u_1, u_2 = answer.trajectory.players(problem.game)
    np.testing.assert_allclose(u_1 + u_2, answer.trajectory.v, atol=1e-12)
    np.testing.assert_allclose(u_2, -u_1 / 4.0, atol=1e-12)


def test_running_cost_integrates_to_the_value() -> None:
    problem, answer = trajectory()
    path, game = answer.trajectory, problem.game
    running = np.sum((path.states[1:] @ game.Q) * path.states[1:], axis=1)
    running += np.sum((path.v @ game.R_eff) * path.v, axis=1)
    integral = path.quadrature(running)
    assert integral[0] == 0.0
    assert np.all(np.diff(integral) > 0.0)
    rest = closed_form(path.states[-1])[0]
    assert integral[-1] + rest == pytest.approx(answer.value, rel=1e-9)
    # and along the way: what is left is the value of the state there
    left = answer.value - integral
    np.testing.assert_allclose(left, [closed_form(state)[0] for state in path.states], atol=2e-4)


def test_quadrature_of_a_trajectory_is_exact_for_polynomials() -> None:
    mesh, rule = np.array([0.5, 1.0, 2.5, 3.0]), RadauRule(3)
    times = Transcription(single_player(two_state()[0]), 3, 3).times(mesh)
    path = Trajectory(mesh, np.append(mesh[0], times), np.zeros((10, 2)), np.zeros((9, 1)), 3)
    np.testing.assert_allclose(times[:3], 0.5 + 0.5 * rule.nodes)
    for power in range(3):
        expected = (np.append(0.5, times) ** (power + 1) - 0.5 ** (power + 1)) / (power + 1)
        np.testing.assert_allclose(path.quadrature(times**power), expected, atol=1e-12)
