"""The shipped game from far states: value, costate, policies, and how meshes converge."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from stationkeep.offline import DirectSolution, DirectSolver, OfflineSettings, Plant
from stationkeep.offline.path import reintegrate
from stationkeep.symbolic import Problem

from .games import FAR_STATE, FAR_VALUE, FAST_STATE, FAST_VALUE, HALF_WIDTHS, Array, quick_scenario


@pytest.fixture(scope="module")
def solver(reference_problem: Problem) -> DirectSolver:
    return DirectSolver(reference_problem, horizon=120.0, n_intervals=24)


@pytest.fixture(scope="module")
def optimum(solver: DirectSolver) -> tuple[DirectSolution, Array]:
    return solver.solve_aligned(FAR_STATE)


def test_value_of_the_shipped_game(optimum: tuple[DirectSolution, Array]) -> None:
    solution, events = optimum
    assert solution.value == pytest.approx(FAR_VALUE, rel=1e-8)
    assert len(events) == 2
    assert np.all(np.isin(events, solution.trajectory.mesh))
    assert solution.iterations < 100


def test_shipped_scenario_is_the_reference_game(reference_problem: Problem) -> None:
    shipped = quick_scenario().station_keeping().problem
    for name in ("Q", "R", "W_d"):
        np.testing.assert_allclose(
            getattr(shipped.game, name), getattr(reference_problem.game, name), rtol=1e-12
        )
    assert shipped.game.gamma == reference_problem.game.gamma == 2.0
    np.testing.assert_array_equal(shipped.scale, reference_problem.scale)
    np.testing.assert_allclose(shipped.P, reference_problem.P, rtol=1e-9, atol=1e-9)
    settings = OfflineSettings()
    assert quick_scenario().offline == settings
    assert settings.horizon is None


def test_reintegration_by_scipy_agrees(optimum: tuple[DirectSolution, Array]) -> None:
    solution, _ = optimum
    assert solution.defect < 1e-5
    assert solution.reintegrated_value == pytest.approx(solution.value, rel=1e-7)


def test_reintegration_notices_a_wrong_trajectory(
    solver: DirectSolver, optimum: tuple[DirectSolution, Array]
) -> None:
    """Half the input is another motion, whatever a solver says of it."""
    path = optimum[0].trajectory
    weak = type(path)(path.mesh, path.times, path.states, 0.5 * path.v, path.degree)
    defect, value = reintegrate(solver.plant, FAR_STATE, weak)
    assert defect > 0.1
    assert abs(value - FAR_VALUE) > 1.0


def test_players_follow_from_the_costate(
    solver: DirectSolver, optimum: tuple[DirectSolution, Array]
) -> None:
    """(8), (9) and the stationary Hamiltonian (7) at ζ, and u_1 + u_2 = v on the way."""
    solution, _ = optimum
    problem = solver.problem
    game = problem.game
    f, g = solver.plant.terms(FAR_STATE)
    push = g.T @ solution.costate
    np.testing.assert_allclose(solution.u_control, -0.5 * np.linalg.inv(game.R) @ push, rtol=1e-12)
    np.testing.assert_allclose(
        solution.u_disturbance, 0.125 * np.linalg.inv(game.W_d) @ push, rtol=1e-12
    )
    v = solution.u_control + solution.u_disturbance
    np.testing.assert_allclose(v, -0.5 * game.R_eff_inverse @ push, rtol=1e-10)
    state_cost = FAR_STATE @ game.Q @ FAR_STATE
    hamiltonian = state_cost + v @ game.R_eff @ v + solution.costate @ (f + g @ v)
    assert abs(hamiltonian) < 1e-6 * state_cost
    assert solution.hji_residual == pytest.approx(abs(hamiltonian) / state_cost, abs=1e-10)
    first = solution.trajectory.v[0]
    np.testing.assert_allclose(first, v, atol=0.05 * np.abs(v).max())
    u_1, u_2 = solution.trajectory.players(game)
    np.testing.assert_allclose(u_1 + u_2, solution.trajectory.v, atol=1e-9)


def linear_cost(problem: Problem, zeta0: Array, horizon: float = 80.0) -> float:
    """Return the cost of the linear H-infinity policy -R_eff^-1 g(ζ)'P ζ, by scipy."""
    plant, game = Plant(problem), problem.game

    def rate(t: float, y: Array) -> Array:
        zeta = y[:-1]
        _, g = plant.terms(zeta)
        v = -game.R_eff_inverse @ g.T @ problem.P @ zeta
        return np.append(plant.rate(zeta, v), zeta @ game.Q @ zeta + v @ game.R_eff @ v)

    answer = solve_ivp(rate, (0.0, horizon), np.append(zeta0, 0.0), "LSODA", rtol=1e-8, atol=1e-8)
    assert answer.success
    end = answer.y[:-1, -1]
    return float(answer.y[-1, -1] + end @ problem.P @ end)


def random_states(n: int, seed: int = 11) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return HALF_WIDTHS * rng.uniform(-1.0, 1.0, (n, 12)) * rng.uniform(0.2, 1.0, (n, 1))


def test_value_is_positive_and_below_the_linear_policy(
    solver: DirectSolver, optimum: tuple[DirectSolution, Array]
) -> None:
    problem = solver.problem
    for zeta0 in (FAR_STATE, *random_states(4)):
        value = solver.solve(zeta0, verify=False).value
        linear = linear_cost(problem, zeta0)
        assert 0.0 < value < linear
        assert value > 0.9 * linear
    assert linear_cost(problem, FAR_STATE) / FAR_VALUE == pytest.approx(1.033, abs=0.005)


def test_small_states_have_the_riccati_value(solver: DirectSolver) -> None:
    for zeta0 in 1e-4 * random_states(2):
        answer = solver.solve(zeta0, verify=False)
        assert answer.value == pytest.approx(zeta0 @ solver.problem.P @ zeta0, rel=1e-3)


@pytest.mark.slow
def test_mesh_study(reference_problem: Problem) -> None:
    """Aligned meshes settle to 1e-10; on others the kinks of |ν|ν slow convergence down."""
    errors: dict[bool, list[float]] = {True: [], False: []}
    for K in (20, 40, 80):
        direct = DirectSolver(reference_problem, horizon=120.0, n_intervals=K)
        for name, zeta0, exact in (
            ("far", FAR_STATE, FAR_VALUE),
            ("fast", FAST_STATE, FAST_VALUE),
        ):
            plain = direct.solve(zeta0, verify=False)
            aligned, events = direct.solve_aligned(zeta0)
            for solution, is_aligned in ((plain, False), (aligned, True)):
                error = abs(solution.value - exact) / exact
                errors[is_aligned].append(error)
                print(f"{name} K={K} aligned={is_aligned}: {solution.value:.8f}, error {error:.1e}")
            assert len(events) == {"far": 2, "fast": 9}[name]
    # far K=20, fast K=20, far K=40, ...
    assert max(errors[True][:2]) < 2e-8
    assert max(errors[True][2:]) < 1e-10
    assert min(errors[False][1::2]) > 1e-7
    assert max(errors[False]) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("zeta0", [FAR_STATE, FAST_STATE], ids=["far", "fast"])
def test_costate_is_the_gradient_of_the_value(reference_problem: Problem, zeta0: Array) -> None:
    """Central differences of the value in every direction, on the aligned mesh."""
    direct = DirectSolver(reference_problem, horizon=120.0, n_intervals=30)
    solution, _ = direct.solve_aligned(zeta0)
    path, h = solution.trajectory, 1e-3
    gradient = np.empty(12)
    for i in range(12):
        step = h * HALF_WIDTHS[i] * np.eye(12)[i]
        ahead, behind = (
            direct.solve(zeta0 + s, mesh=path.mesh, guess=path, verify=False).value
            for s in (step, -step)
        )
        gradient[i] = (ahead - behind) / (2.0 * h * HALF_WIDTHS[i])
    unit = float(np.linalg.norm(solution.costate * HALF_WIDTHS))
    gap = np.abs((gradient - solution.costate) * HALF_WIDTHS) / unit
    print(f"largest gap of costate to finite difference: {gap.max():.1e}")
    assert gap.max() < 1e-4
    large = np.abs(solution.costate * HALF_WIDTHS) > 0.01 * unit
    np.testing.assert_allclose(gradient[large], solution.costate[large], rtol=1e-4)
