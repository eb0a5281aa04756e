"""Textbook problems: closed forms, hand-written linearisations, conservation laws, and learning."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from stationkeep.offline import OfflineSolver
from stationkeep.offline.plant import Plant
from stationkeep.online import Learner, LearnerSettings
from stationkeep.online.settings import SampleSettings
from stationkeep.symbolic import (
    Basis,
    GammaTooSmallError,
    InputError,
    Problem,
    ValueFunctions,
    quadratic,
)
from stationkeep.symbolic.textbook import double_integrators, quadrotor, two_state_game
from stationkeep.symbolic.textbook.integrators import state_names, state_units
from stationkeep.symbolic.textbook.quadrotor import GRAVITY, INERTIA, MASS, STATE_NAMES, STATE_UNITS

Array = NDArray[np.float64]
G, M, J = 9.81, 0.028, 16.655602e-6  # m/s^2, kg, kg m^2
MIRROR = np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0])  # of the quadrotor's states, left and right


def drawn(problem: Problem, n_states: int, seed: int) -> Array:
    """Return states of the envelope, uniform, shrunk by a factor from 0.1 to 1, (n_states, n)."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.0, 1.0, (n_states, problem.n_states)) * problem.scale
    return np.asarray(corners * rng.uniform(0.1, 1.0, (n_states, 1)))


def per_axis(weights: tuple[float, float, float], kappa: float = 0.0, delta: float = 0.0) -> Array:
    """Return P of q_ddot = -κ q - δ q_dot + v with cost q_p q^2 + q_v q_dot^2 + ρ v^2, (2, 2).

    By spectral factorisation instead of the Riccati equation: the closed loop s^2 + d s + k has
    |jω d + k - ω^2|^2 = |jω δ + κ - ω^2|^2 + (q_p + q_v ω^2) / ρ, so its gain is (k - κ, d - δ).
    """
    q_p, q_v, rho = weights
    k = np.sqrt(kappa**2 + q_p / rho)
    d = np.sqrt(2.0 * k - 2.0 * kappa + delta**2 + q_v / rho)
    p_12, p_22 = rho * (k - kappa), rho * (d - delta)
    # p_11 is the cost of release from rest at q = 1: integrals of q^2, q_dot^2 and q q_dot
    squares, cross = ((k + d**2) / (2.0 * d * k), k / (2.0 * d)), -0.5
    a, b = k - kappa, d - delta
    effort = a**2 * squares[0] + b**2 * squares[1] + 2.0 * a * b * cross
    p_11 = q_p * squares[0] + q_v * squares[1] + rho * effort
    return np.array([[p_11, p_12], [p_12, p_22]])


@pytest.mark.parametrize(
    ("n", "weights", "gamma"),
    [(1, (1.0, 1.0, 1.0), 2.0), (3, (4.0, 0.5, 2.0), 1.2), (6, (1.0, 3.0, 0.1), np.inf)],
)
def test_every_double_integrator_has_the_closed_form_value(
    n: int, weights: tuple[float, float, float], gamma: float
) -> None:
    """Each axis by itself, with R_eff = r / (1 - γ^-2) in the place of r."""
    q_p, q_v, r = weights
    problem = double_integrators(
        n, position_weight=q_p, velocity_weight=q_v, input_weight=r, gamma=gamma
    )
    rho = r / (1.0 - gamma**-2.0)
    expected = np.kron(per_axis((q_p, q_v, rho)), np.eye(n))
    assert pytest.approx(expected, rel=1e-10, abs=1e-12) == problem.P
    assert expected[0, n] == pytest.approx(np.sqrt(q_p * rho))
    assert expected[0, 0] == pytest.approx(np.sqrt(q_p * (q_v + 2.0 * np.sqrt(q_p * rho))))


@pytest.mark.parametrize(("k", "c"), [(2.0, 0.0), (0.0, 0.7), (3.0, 0.4)])
def test_a_chain_has_the_closed_form_value_of_its_modes(k: float, c: float) -> None:
    """cos(π (j - 1)(i - 1/2)/n) are the modes of a chain with free ends, λ_j = 4 sin^2(π (j-1)/2n)."""
    n, weights, gamma = 5, (2.0, 0.5, 1.5), 1.7
    problem = double_integrators(
        n,
        stiffness=k,
        damping=c,
        position_weight=weights[0],
        velocity_weight=weights[1],
        input_weight=weights[2],
        gamma=gamma,
    )
    rho = weights[2] / (1.0 - gamma**-2.0)
    expected = np.zeros((2 * n, 2 * n))
    for j in range(n):
        mode = np.cos(np.pi * j * (np.arange(n) + 0.5) / n)
        mode /= np.linalg.norm(mode)
        stretch = 4.0 * np.sin(np.pi * j / (2 * n)) ** 2
        block = per_axis((weights[0], weights[1], rho), k * stretch, c * stretch)
        expected += np.kron(block, np.outer(mode, mode))
    assert pytest.approx(expected, rel=1e-9, abs=1e-11) == problem.P


def test_a_chain_pushes_neighbours_together_and_loses_energy_to_its_dampers() -> None:
    """q'L q is the sum of squared stretches; momentum is kept and E_dot = -c Σ (q̇_{i+1} - q̇_i)^2."""
    n, k, c = 4, 3.0, 0.4
    plant = Plant(double_integrators(n, stiffness=k, damping=c))
    for zeta in np.random.default_rng(1).uniform(-2.0, 2.0, (5, 2 * n)):
        rate = plant.rate(zeta, np.zeros(n))
        stretch, stretching = np.diff(zeta[:n]), np.diff(zeta[n:])
        assert rate[:n] == pytest.approx(zeta[n:])
        assert rate[n:].sum() == pytest.approx(0.0, abs=1e-12)
        power = zeta[n:] @ rate[n:] + k * stretch @ stretching
        assert power == pytest.approx(-c * stretching @ stretching)


def test_a_chain_solved_offline_has_its_closed_form_value() -> None:
    problem = double_integrators(3, stiffness=2.0, damping=0.3)
    zeta = np.array([1.5, -1.0, 0.5, 0.3, -1.2, 0.8])
    optimum = OfflineSolver(problem).solve(zeta)
    assert not optimum.faults
    assert optimum.value == pytest.approx(zeta @ problem.P @ zeta, rel=1e-8)
    assert optimum.costate == pytest.approx(2.0 * problem.P @ zeta, rel=1e-6)


def test_two_state_game_has_the_closed_form_value() -> None:
    """H of (6) is zero for V = ζ_1^2/2 + ζ_2^2 under its own policies, and P is half its Hessian."""
    problem = two_state_game(R=0.3, gamma=0.7)
    plant = Plant(problem)
    for zeta in np.random.default_rng(0).uniform(-2.0, 2.0, (100, 2)):
        f, g = plant.terms(zeta)
        V_zeta = np.array([zeta[0], 2.0 * zeta[1]])
        u_1, u_2 = problem.game.policies(g, V_zeta)
        assert problem.game.hamiltonian(zeta, f, g, V_zeta, u_1, u_2) == pytest.approx(0.0, abs=1e-11)
    assert pytest.approx(np.diag([0.5, 1.0]), abs=1e-12) == problem.P


def test_quadrotor_linearises_to_the_textbook_matrices() -> None:
    """x_ddot = -g θ, z_ddot = v_1 / m, θ_ddot = v_2 / I."""
    A, B = np.zeros((6, 6)), np.zeros((6, 2))
    A[0, 3] = A[1, 4] = A[2, 5] = 1.0
    A[3, 2] = -G
    B[4, 0], B[5, 1] = 1.0 / M, 1.0 / J
    found = quadrotor().linearization
    assert pytest.approx(A, abs=1e-12) == found[0]
    assert pytest.approx(B, rel=1e-12) == found[1]
    assert (GRAVITY, MASS, INERTIA) == (G, M, J)


def test_quadrotor_height_alone_is_a_double_integrator() -> None:
    """Upright the height parts from the rest, with R_eff m^2 as the weight of its acceleration."""
    problem = quadrotor(gamma=3.0)
    rho = M**2 / (0.3 * M * G) ** 2 / (1.0 - 3.0**-2)
    expected = per_axis((1.0, 0.25, rho))
    assert pytest.approx(expected, rel=1e-9) == problem.P[np.ix_([1, 4], [1, 4])]
    assert problem.P[np.ix_([1, 4], [0, 2, 3, 5])] == pytest.approx(0.0, abs=1e-10)


def test_quadrotor_gains_as_much_energy_as_its_rotors_give() -> None:
    """E = m (ẋ^2 + ż^2)/2 + I θ̇^2/2 + m g z changes by T times the speed along the thrust, plus M θ̇."""
    plant = Plant(quadrotor())
    rng = np.random.default_rng(2)
    for zeta in rng.uniform(-2.0, 2.0, (20, 6)):
        v = rng.uniform(-1.0, 1.0, 2) * np.array([M * G, 50.0 * J])
        rate = plant.rate(zeta, v)
        thrust = (M * G + v[0]) * np.array([-np.sin(zeta[2]), np.cos(zeta[2])])
        gained = M * zeta[3:5] @ rate[3:5] + J * zeta[5] * rate[5] + M * G * rate[1]
        assert gained == pytest.approx(thrust @ zeta[3:5] + v[1] * zeta[5], rel=1e-9, abs=1e-9)


def test_quadrotor_without_thrust_falls_along_a_parabola() -> None:
    plant, start = Plant(quadrotor()), np.array([0.3, 0.2, 0.4, 1.0, 1.5, -2.0])
    off = np.array([-M * G, 0.0])
    end = solve_ivp(lambda t, zeta: plant.rate(zeta, off), (0.0, 0.8), start, rtol=1e-10, atol=1e-12)
    t = 0.8
    fallen = [0.3 + t, 0.2 + 1.5 * t - G * t**2 / 2, 0.4 - 2.0 * t, 1.0, 1.5 - G * t, -2.0]
    assert end.y[:, -1] == pytest.approx(fallen, rel=1e-8)


def test_quadrotor_is_the_same_seen_in_a_mirror() -> None:
    plant = Plant(quadrotor())
    for zeta in np.random.default_rng(3).uniform(-1.0, 1.0, (5, 6)):
        v = np.array([0.1, 1e-4])
        mirrored = plant.rate(MIRROR * zeta, np.array([v[0], -v[1]]))
        assert mirrored == pytest.approx(MIRROR * plant.rate(zeta, v))


def test_quadrotor_of_any_size_has_the_same_linear_game() -> None:
    """Weights are relative to the weight m g and to I: another vehicle needs the same accelerations."""
    assert pytest.approx(quadrotor().P, rel=1e-8) == quadrotor(mass=0.5, inertia=3e-3).P


def test_quadrotor_optima_are_certified() -> None:
    """They cost less than the linear policy, and mirrored states cost the same."""
    problem = quadrotor()
    solver, plant = OfflineSolver(problem), Plant(problem)
    for zeta in drawn(problem, 3, seed=4):
        optimum, mirrored = solver.solve(zeta), solver.solve(MIRROR * zeta)
        assert not optimum.faults
        assert mirrored.value == pytest.approx(optimum.value, rel=1e-8)
        assert mirrored.costate == pytest.approx(MIRROR * optimum.costate, rel=1e-5, abs=1e-6)
        assert optimum.value < linear_cost(plant, zeta)


def linear_cost(plant: Plant, start: Array) -> float:
    """Return the cost of the linear H-infinity policies, up to 20 s."""
    times = np.array([0.0, 20.0])
    _, cost = plant.simulate(start, lambda t, zeta: plant.linear_policy(zeta), times, restart=False)
    return float(cost[-1])


def game_cost(learner: Learner, start: Array, duration: float, dt: float) -> float:
    """Return the cost of the game with both players, learning every dt [s]."""
    problem, plant, state = learner.problem, Plant(learner.problem), np.append(start, 0.0)
    n = problem.n_states

    def rates(t: float, y: Array) -> Array:
        u_1, u_2 = learner.policies(y[:n])
        return np.append(plant.rate(y[:n], u_1 + u_2), problem.game.local_cost(y[:n], u_1, u_2))

    for _ in range(round(duration / dt)):
        learner.step(state[:n], dt)
        state = solve_ivp(rates, (0.0, dt), state, rtol=1e-8, atol=1e-10).y[:, -1]
    return float(state[n] + state[:n] @ problem.P @ state[:n])


@pytest.mark.slow
def test_learning_improves_on_the_linear_policy_of_the_quadrotor() -> None:
    """V* <= learned < linear from every state, and a tenth of the linear policy's regret in all."""
    problem = quadrotor()
    basis = Basis.build("quadratic", quadratic, problem.zeta, problem.scale)
    assert basis.n_basis == 21
    functions = ValueFunctions(problem, basis)
    settings = LearnerSettings(
        error="costate",
        safeguard=True,
        gain_actor_1=16.0,
        gain_actor_2=16.0,
        forgetting=4.0,
        leash=0.001,
        period=0.1,
        horizon=8.0,
        steps=150,
    )
    paths = SampleSettings(paths=3, spread=0.2)
    solver, plant = OfflineSolver(problem), Plant(problem)
    weights = basis.quadratic_weights(problem.P)
    regrets = []
    for zeta in drawn(problem, 8, seed=20):
        optimum = solver.solve(zeta)
        assert not optimum.faults
        learner = Learner(
            problem, basis, settings, np.empty((0, 6)), weights, functions=functions, paths=paths
        )
        learned = game_cost(learner, zeta, 6.0, 0.1)
        linear = linear_cost(plant, zeta)
        assert (1.0 - 1e-7) * optimum.value < learned < linear
        regrets.append((learned / optimum.value - 1.0, linear / optimum.value - 1.0))
    learned_regret, linear_regret = np.array(regrets).T
    assert 0.005 < linear_regret.max() < 0.1  # there is something to learn, and not too much
    assert learned_regret.sum() < 0.1 * linear_regret.sum()


def test_names_and_units_are_those_of_the_states() -> None:
    assert len(STATE_NAMES) == len(STATE_UNITS) == quadrotor().n_states
    assert state_names(2) == ("q_1", "q_2", "q_dot_1", "q_dot_2")
    assert len(state_units(3)) == double_integrators(3).n_states


@pytest.mark.parametrize(
    ("make", "needed"),
    [
        (lambda: quadrotor(mass=0.0), "the mass is 0, but must be a positive number of kg"),
        (lambda: quadrotor(inertia=np.nan), "positive number of kg m^2"),
        (lambda: double_integrators(0), "at least one"),
        (lambda: double_integrators(2, stiffness=-1.0), "the stiffness is -1"),
        (lambda: double_integrators(2, damping=np.inf), "the damping is inf"),
        (lambda: double_integrators(2, input_weight=0.0), "R must be positive definite"),
    ],
)
def test_impossible_parameters_are_refused(
    make: Callable[[], Problem], needed: str, one_sentence: Callable[[BaseException], str]
) -> None:
    with pytest.raises(InputError) as caught:
        make()
    assert needed in one_sentence(caught.value)


@pytest.mark.parametrize("make", [quadrotor, double_integrators, two_state_game])
def test_gamma_at_the_threshold_is_refused(make: Callable[..., Problem]) -> None:
    """W_d = R (and R = 1 in the two-state game): the threshold is γ = 1."""
    assert make(gamma=1.01).n_inputs > 0
    with pytest.raises(GammaTooSmallError):
        make(gamma=1.0)


def test_inverse_dynamics_of_a_chain_ask_for_what_the_springs_do_not_give() -> None:
    problem = double_integrators(2, stiffness=5.0)
    inverse = problem.inverse_dynamics
    assert inverse is not None
    v = casadi.Function("v", [problem.zeta, inverse.acceleration], [inverse.v])
    # stretched by 0.2: the spring pulls the masses together with 1 N each
    found = np.array(v([0.0, 0.2, 0.0, 0.0], [0.0, 0.0])).ravel()
    assert found == pytest.approx([-1.0, 1.0])
