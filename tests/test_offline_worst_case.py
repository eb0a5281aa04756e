"""Worst cases, attenuation and measured gains: closed forms, and policies that are lost."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
import pytest
from casadi import SX
from scipy.integrate import solve_ivp
from stationkeep.offline import (
    BestResponse,
    ControlPolicy,
    DirectSolver,
    GainMeter,
    WorstCaseSolver,
    learned_policy,
    linear_policy,
)
from stationkeep.symbolic import Game, InputError, Problem, RunError

from .games import TWO_STATE_WEIGHTS, Array, two_state

Check = Callable[[BaseException], str]


def optimal_policy(problem: Problem) -> SX:
    """u_1* = -1/2 R^-1 g'V_ζ' of the two-state game, with V_ζ = (ζ_1, 2 ζ_2) and g = (0, c)."""
    zeta = problem.zeta
    return SX(-(casadi.cos(2 * zeta[0]) + 2) * zeta[1])


def value(zeta: Array) -> float:
    return float(0.5 * zeta[0] ** 2 + zeta[1] ** 2)


@pytest.fixture(scope="module")
def optimal() -> WorstCaseSolver:
    problem, _, _ = two_state()
    return WorstCaseSolver(ControlPolicy(problem, optimal_policy(problem)), horizon=25.0)


@pytest.fixture(scope="module")
def linear() -> WorstCaseSolver:
    problem, _, _ = two_state()
    return WorstCaseSolver(ControlPolicy(problem, linear_policy(problem)), horizon=25.0)


def test_worst_case_of_the_optimal_policy_is_the_value(optimal: WorstCaseSolver) -> None:
    """From many states; and it attains the level γ = 2 with the bias V*, and no better one."""
    for zeta in np.random.default_rng(4).uniform(-2.0, 2.0, (8, 2)):
        worst = optimal.solve(zeta)
        assert worst.unbounded is None
        assert worst.cost == pytest.approx(value(zeta), rel=1e-8)
        assert worst.reintegrated == pytest.approx(worst.cost, rel=1e-8)
        assert worst.second_order is not None
        assert worst.second_order.holds
        np.testing.assert_allclose(worst.starts, value(zeta), rtol=1e-7)
        assert optimal.attenuation(worst, value(zeta)) == pytest.approx(2.0, rel=1e-6)


def test_worst_disturbance_of_the_optimal_policy_is_that_of_the_game(optimal: WorstCaseSolver) -> None:
    """u_2* = 1/(2 γ^2) g'V_ζ' = c ζ_2 / 4 along the whole trajectory."""
    path = optimal.solve(np.array([1.0, -1.2])).path
    assert path is not None
    states = path.states[1:]
    expected = (np.cos(2.0 * states[:, 0]) + 2.0) * states[:, 1] / 4.0
    np.testing.assert_allclose(path.v[:, 0], expected, atol=1e-5)


def test_no_disturbance_costs_more_than_the_worst_case(linear: WorstCaseSolver) -> None:
    """Random ones, integrated by scipy on equations written out here, stay below and get near."""
    zeta0, P, gain = np.array([1.4, 0.9]), linear.problem.P, linear.policy.gain[0]
    worst = linear.solve(zeta0)
    assert worst.cost > value(zeta0) * (1.0 + 1e-3)
    rng = np.random.default_rng(8)

    def cost(slope: float, amplitude: float, omega: float) -> float:
        def rate(t: float, y: Array) -> list[float]:
            x, u = y[:2], float(-gain @ y[:2])
            w = slope * x[1] + amplitude * np.exp(-t) * np.cos(omega * t)
            c = np.cos(2.0 * x[0]) + 2.0
            drift = -x[0] / 2.0 - x[1] / 2.0 * (1.0 - 0.75 * c**2)
            return [-x[0] + x[1], drift + c * (u + w), x @ x + u**2 - 4.0 * w**2]

        answer = solve_ivp(rate, (0.0, 20.0), [*zeta0, 0.0], rtol=1e-8, atol=1e-10)
        end = answer.y[:2, -1]
        return float(answer.y[2, -1] + end @ P @ end)

    costs = [cost(rng.uniform(-0.2, 0.9), rng.normal(0.0, 0.5), rng.uniform(0.2, 3)) for _ in range(60)]
    assert 0.9 * worst.cost < max(costs) <= worst.cost * (1.0 + 1e-7)


def test_attenuation_of_a_suboptimal_policy(linear: WorstCaseSolver) -> None:
    """The worst case at the level that is returned is the bias, by a second maximisation.

    With a bias below what the policy costs without a disturbance no level is enough.
    """
    problem, zeta0 = linear.problem, np.array([0.5, -1.3])
    worst = linear.solve(zeta0)
    bias = worst.cost - 0.05
    level = linear.attenuation(worst, bias)
    assert level > 2.0
    game = problem.game
    easier = problem.with_game(Game(game.Q, game.R, game.W_d, level))
    again = WorstCaseSolver(ControlPolicy(easier, linear_policy(problem)), horizon=25.0).solve(zeta0)
    assert again.cost == pytest.approx(bias, rel=1e-6)
    assert linear.attenuation(worst, 0.5 * worst.cost) == np.inf


def test_learned_policy_with_the_exact_weights_is_the_optimal_one() -> None:
    problem, basis, _ = two_state()
    policy = learned_policy(problem, basis, TWO_STATE_WEIGHTS)
    both = casadi.Function("both", [problem.zeta], [policy, optimal_policy(problem)])
    for zeta in np.random.default_rng(1).uniform(-2.0, 2.0, (5, 2)):
        learned, exact = both(zeta)
        assert float(learned) == pytest.approx(float(exact), abs=1e-12)


def test_policy_that_leaves_the_plant_unstable_is_unbounded(linear: WorstCaseSolver) -> None:
    problem, _, _ = two_state()
    solver = WorstCaseSolver(ControlPolicy(problem, 0.0 * optimal_policy(problem)), horizon=25.0)
    worst = solver.solve(np.array([0.3, 0.2]))
    assert worst.unbounded == "the linearised closed loop is not stable"
    assert worst.excess(1.0) == np.inf
    with pytest.raises(RunError, match="no worst-case disturbance"):
        solver.attenuation(worst, 1.0)
    with pytest.raises(InputError, match="not stable"):
        GainMeter(solver.policy)


def test_escape_that_the_linearised_loop_does_not_know() -> None:
    """x_dot = -2.1 x + x^3 attains γ near rest, but never comes back from beyond sqrt(2.1) = 1.449."""
    x, y = SX.sym("x"), SX.sym("y")
    game, g = Game(np.eye(2), np.eye(1), np.eye(1), 2.0), SX(np.array([[1.0], [0.0]]))
    drift = casadi.vertcat(x**3 - 2 * x, -y)
    problem = Problem("escape", casadi.vertcat(x, y), drift, g, game, np.ones(2))
    policy = ControlPolicy(problem, -0.1 * x)
    assert policy.l2_gain < 2.0
    solver = WorstCaseSolver(policy, horizon=20.0)
    assert solver.solve(np.array([0.3, 0.0])).unbounded is None
    worst = solver.solve(np.array([1.44, 0.0]))
    assert worst.unbounded is not None
    assert "runs off" in worst.unbounded


def test_excursions_beyond_the_envelope_count_as_run_off(optimal: WorstCaseSolver) -> None:
    """In half-widths, and from where the state began if that is outside."""
    inside, outside = np.array([0.0, 0.3]), np.array([3.0, 0.0])
    assert optimal.solve(inside).reach == pytest.approx(0.15)
    worst = WorstCaseSolver(optimal.policy, horizon=25.0, reach=0.1).solve(inside)
    assert worst.unbounded is not None
    assert "reaches 0.15 half-widths" in worst.unbounded
    assert WorstCaseSolver(optimal.policy, horizon=25.0, reach=1.2).solve(outside).unbounded is None


def test_policies_of_another_game_leave_a_gap() -> None:
    """Along the optimum for γ = 1.2 the two policies are no saddle of the game at γ = 2."""
    problem, _, _ = two_state()
    other = DirectSolver(problem.with_gamma(1.2), horizon=25.0, n_intervals=30)
    zeta0 = np.array([0.8, 0.6])
    path = other.solve(zeta0).trajectory
    found = BestResponse(problem).solve(zeta0, value(zeta0), path)
    assert found.upper > value(zeta0) * (1.0 + 1e-3)
    assert found.lower < value(zeta0) * (1.0 - 1e-3)


def test_measured_gain_of_a_linear_plant_nears_its_norm() -> None:
    """Below the H-infinity norm for any horizon, and nearer for a longer one."""
    problem = two_state()[0].linearized()
    policy = ControlPolicy(problem, linear_policy(problem))
    short, long = (GainMeter(policy, horizon=T).measure(1.0).gain for T in (5.0, 40.0))
    assert short < long < policy.l2_gain
    assert long == pytest.approx(policy.l2_gain, rel=5e-3)


@pytest.mark.parametrize("energy", [1e-4, 1.0, 100.0])
def test_optimal_policy_attains_gamma_at_every_energy(optimal: WorstCaseSolver, energy: float) -> None:
    """V* is a storage function: from rest ∫ |z|^2 <= γ^2 ∫ d^2, and the bound is a real disturbance."""
    found = GainMeter(optimal.policy, horizon=20.0).measure(energy)
    assert 1.3 < found.gain < 2.0
    W_d = optimal.problem.game.W_d
    spent = found.step * float(np.sum(found.disturbance @ W_d * found.disturbance))
    assert spent == pytest.approx(energy)
    with pytest.raises(InputError, match="positive"):
        GainMeter(optimal.policy).measure(-energy)


def test_bad_policies(one_sentence: Check) -> None:
    problem, _, _ = two_state()
    cases = (
        (SX.zeros(2), "column of 1"),
        (SX.sym("other", 2)[0], "own state symbol"),
        (problem.zeta[0] + 1.0, "zero at the station"),
    )
    for policy, word in cases:
        with pytest.raises(InputError, match=word) as caught:
            ControlPolicy(problem, policy)
        one_sentence(caught.value)
