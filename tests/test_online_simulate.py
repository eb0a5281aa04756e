"""Any problem in closed loop, against the matrix exponential and against what its domain says."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from scipy.linalg import expm
from stationkeep.online import FunctionPolicy, simulate
from stationkeep.symbolic import Bound, Game, InputError, Problem
from stationkeep.symbolic.textbook import double_integrators, quadrotor, two_state_game

from .games import Array

START = np.array([0.5, -0.3, 0.2, 0.1])
PERIOD = 0.05


def held(A: Array, B: Array, dt: float) -> tuple[Array, Array]:
    """Return exp(A dt) and ∫ exp(A s) ds B, of an input that is held."""
    n, k = B.shape
    whole = expm(np.block([[A, B], [np.zeros((k, n + k))]]) * dt)
    return whole[:n, :n], whole[:n, n:]


@pytest.fixture(scope="module")
def problem() -> Problem:
    return double_integrators(2, stiffness=1.5, damping=0.2)


def test_a_held_linear_law_is_the_matrix_exponentials(problem: Problem) -> None:
    """In the game u_2 = -γ^-2 W_d^-1 R u_1 adds to the held input: v = R_eff^-1 R u_1."""
    K = problem.linear_gains[0]
    A, B = problem.linearization
    record = simulate(problem, lambda zeta: -K @ zeta, START, 2.0, control_period=PERIOD)
    F, G = held(A, B, PERIOD)
    answer = np.eye(2) - problem.game.disturbance_inverse @ problem.game.R
    zeta = START
    for found in record["zeta"].values:
        np.testing.assert_allclose(found, zeta, atol=1e-7)
        zeta = F @ zeta - G @ answer @ K @ zeta
    assert record["zeta"].dims == ("time", "state")
    assert list(record["state"].values) == list(problem.state_names)


def test_the_cost_is_the_integral_along_the_run(problem: Problem) -> None:
    """Between two steps ζ'Qζ + u'R u and γ^2 d'W_d d by Simpson's rule on exact states."""
    K, game = problem.linear_gains[0], problem.game
    push = np.array([0.3, -0.2])
    record = simulate(
        problem,
        lambda zeta: -K @ zeta,
        START,
        0.5,
        control_period=PERIOD,
        mode="disturbed",
        disturbance=lambda t, zeta: push,
    )
    A, B = problem.linearization
    cost = 0.0
    for zeta in record["zeta"].values[:-1]:
        u = -K @ zeta
        inside = [F @ zeta + G @ (u + push) for F, G in (held(A, B, h) for h in (0.0, 0.025, 0.05))]
        rates = [z @ game.Q @ z + u @ game.R @ u for z in inside]
        cost += PERIOD / 6.0 * (rates[0] + 4.0 * rates[1] + rates[2])
    assert record["cost"].values[-1] == pytest.approx(cost, rel=1e-6)
    expected = 0.5 * game.gamma**2 * push @ game.W_d @ push
    assert record["attenuated"].values[-1] == pytest.approx(expected, rel=1e-9)
    np.testing.assert_array_equal(record["u_disturbance"].values, np.tile(push, (11, 1)))


def test_a_disturbance_enters_through_a_matrix_of_its_own() -> None:
    """x_dot = -x + u + 2 d from 0 under d = 1 with u = 0: x = 2 (1 - e^-t)."""
    x = SX.sym("x", 1)
    one = Problem(
        "one state", x, -x, SX(DM([1.0])), Game([1.0], [1.0], [1.0], 2.0), np.ones(1), SX(DM([2.0]))
    )
    assert not one.same_inputs
    with pytest.raises(InputError, match="control and disturbance enter through different matrices"):
        _ = one.input_matrix
    record = simulate(
        one, lambda zeta: np.zeros(1), [0.0], 1.0, mode="disturbed", disturbance=lambda t, z: np.ones(1)
    )
    np.testing.assert_allclose(record["zeta"].values[-1], 2.0 * (1.0 - np.exp(-1.0)), rtol=1e-7)


def test_a_run_ends_where_the_equations_end() -> None:
    """Without control a spinning quadrotor passes 90 degrees after (π/2) / θ_dot seconds."""
    spin = 3.0
    record = simulate(quadrotor(), lambda zeta: np.zeros(2), [0, 0, 0, 0, 0, spin], 2.0)
    assert "the angle theta" in record.attrs["stopped"]
    assert record["time"].values[-1] == pytest.approx(np.pi / 2 / spin, abs=0.02)


def test_what_is_refused() -> None:
    game = two_state_game()
    with pytest.raises(InputError, match=r"2 numbers \(x_1,x_2\)"):
        simulate(game, lambda zeta: np.zeros(1), [1.0], 1.0)
    with pytest.raises(InputError, match="must stay inside"):
        simulate(quadrotor(), lambda zeta: np.zeros(2), [0, 0, 2.0, 0, 0, 0], 1.0)
    with pytest.raises(InputError, match="the second player is the disturbance"):
        simulate(game, lambda zeta: np.zeros(1), [1.0, 0.0], 1.0, disturbance=lambda t, z: np.ones(1))
    with pytest.raises(InputError, match="input of shape"):
        simulate(game, lambda zeta: np.zeros(3), [1.0, 0.0], 1.0)
    with pytest.raises(InputError, match="duration"):
        simulate(game, lambda zeta: np.zeros(1), [1.0, 0.0], -1.0)


def test_a_bound_is_known_to_the_problem() -> None:
    x = SX.sym("x", 1)
    bound = Bound(1 - casadi.fabs(x), "x is {}, but must stay within 1", x)
    arguments = (x, -x, SX(DM([1.0])), Game([1.0], [1.0], [1.0], 2.0), np.ones(1))
    problem = Problem("bounded", *arguments, domain=(bound,))
    assert problem.outside(np.array([0.5])) is None
    assert problem.outside(np.array([1.5])) == "x is 1.5, but must stay within 1"
    far = Bound(casadi.fabs(x) - 1, "x must be away from 0")
    with pytest.raises(InputError, match="away from 0"):  # the origin has to be inside
        Problem("bounded", *arguments, domain=(far,))


def test_names_are_one_for_each() -> None:
    x = SX.sym("x", 2)
    plant = (x, -x, SX.eye(2), Game(np.eye(2), np.eye(2), np.eye(2), 2.0), np.ones(2))
    assert Problem("two", *plant).state_names == ("x1", "x2")
    assert Problem("two", *plant).input_names == ("u1", "u2")
    with pytest.raises(InputError, match="3 state names, but 2 states"):
        Problem("two", *plant, state_names=("a", "b", "c"))


def test_a_function_as_a_policy_answers_as_at_the_saddle() -> None:
    """V* = ζ_1^2 / 2 + ζ_2^2: u_1* = -c ζ_2 / R and u_2* = c ζ_2 / γ^2 with c = cos(2 ζ_1) + 2."""
    game, zeta = two_state_game(R=1.0, gamma=2.0), np.array([0.4, -0.7])
    c = np.cos(2 * zeta[0]) + 2
    policy = FunctionPolicy(game, lambda zeta: np.array([-c * zeta[1]]))
    np.testing.assert_allclose(policy.step(zeta, 0.1), -c * zeta[1])
    np.testing.assert_allclose(policy.u_disturbance, c * zeta[1] / 4.0)
