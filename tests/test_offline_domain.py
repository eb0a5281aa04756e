"""Where equations have a meaning: bounds that are a problem's own, and none that belong to a vehicle.

A double integrator with Q = diag(q_1, q_2) and r = R_eff is a linear-quadratic game whose Riccati
equation is solved by hand: p_12 = sqrt(q_1 r), p_22 = sqrt(r (q_2 + 2 p_12)), p_11 = p_12 p_22 / r.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi
import numpy as np
import pytest
import scipy.linalg
from casadi import DM, SX
from stationkeep.offline import (
    BestResponse,
    ControlPolicy,
    DirectSolver,
    GainMeter,
    GammaCurveSolver,
    OfflineSettings,
    SaddleSolver,
    ScheduledWorstCase,
    WeightSchedule,
    WorstCaseSolver,
    linear_policy,
    solve,
)
from stationkeep.offline.direct import against_known
from stationkeep.offline.path import Domain
from stationkeep.offline.responses import ClairvoyantSolver
from stationkeep.symbolic import (
    Basis,
    Bound,
    Game,
    InputError,
    InverseDynamics,
    Problem,
    RunError,
    quadratic,
)

from .games import Array

Check = Callable[[BaseException], str]
GAMMA, START, LIMIT = 2.0, np.array([1.0, 0.0]), 0.3  # the way home from START needs a speed of 0.4


def integrators(k: int, *, actuated: bool = True, limit: float | None = None) -> Problem:
    """Return k double integrators with unit weights; `limit` bounds the first speed."""
    zeta, a = SX.sym("zeta", 2 * k), SX.sym("a", k)
    bounds = ()
    if limit is not None:
        bounds = (Bound(limit**2 - zeta[k] ** 2, "the speed is {}, but must be small", zeta[k]),)
    return Problem(
        name="integrators",
        zeta=zeta,
        drift=casadi.vertcat(zeta[k:], SX(k, 1)),
        control_matrix=SX(DM(np.vstack([np.zeros((k, k)), np.eye(k)]))),
        game=Game(np.eye(2 * k), np.eye(k), np.eye(k), GAMMA),
        scale=np.ones(2 * k),
        domain=bounds,
        inverse_dynamics=InverseDynamics(a, a) if actuated else None,
    )


def riccati_by_hand() -> Array:
    r = 1.0 / (1.0 - GAMMA**-2)
    p_12 = np.sqrt(r)
    p_22 = np.sqrt(r * (1.0 + 2.0 * p_12))
    return np.array([[p_12 * p_22 / r, p_12], [p_12, p_22]])


def optimal_state(t: float) -> Array:
    """Return ζ(t) from START under the game's optimal policies."""
    r = 1.0 / (1.0 - GAMMA**-2)
    closed = np.array([[0.0, 1.0], -riccati_by_hand()[1] / r])
    return np.asarray(scipy.linalg.expm(closed * t) @ START)


@pytest.mark.parametrize("actuated", [True, False])
def test_twelve_states_that_are_no_vehicle_know_no_pitch(actuated: bool) -> None:
    """V = ζ'P ζ from 2 in the fifth state, which of a vehicle would be a pitch of 115 degrees."""
    zeta0 = np.zeros(12)
    zeta0[[0, 4, 7]] = 1.0, 2.0, -0.5
    P = np.kron(riccati_by_hand(), np.eye(6))
    answer = solve(integrators(6, actuated=actuated), zeta0)
    assert answer.faults == []
    assert answer.value == pytest.approx(zeta0 @ P @ zeta0, rel=1e-8)
    np.testing.assert_allclose(answer.costate, 2.0 * P @ zeta0, rtol=1e-5, atol=1e-5)


def test_a_trajectory_that_leaves_is_told_by_its_first_time(one_sentence: Check) -> None:
    zeta = SX.sym("zeta", 2)
    domain = Domain(zeta, (Bound(1.0 - zeta[0], "x1 is {}, not below 1", zeta[0]),))
    states = np.array([[0.0, 5.0], [0.9, 5.0], [1.5, 5.0], [np.nan, 5.0]])
    domain.require(np.arange(2.0), states[:2])
    with pytest.raises(RunError, match=r"after 0\.2 s .* leaves the domain: x1 is 1\.5, not") as caught:
        domain.require(0.1 * np.arange(4), states)
    one_sentence(caught.value)
    with pytest.raises(RunError, match="x1 is nan"):
        domain.require(np.zeros(1), states[3:])


@pytest.mark.parametrize("how", ["newton", "ipopt", "aligned", "certified", "saddle"])
def test_an_optimum_outside_the_domain_is_none(how: str, one_sentence: Check) -> None:
    problem = integrators(1, limit=LIMIT)
    settings = OfflineSettings(horizon=20.0, rounds=1)
    calls: dict[str, Callable[[], object]] = {
        "newton": lambda: DirectSolver(problem, horizon=20.0).solve(START, safety_net=False),
        "ipopt": lambda: DirectSolver(problem, horizon=20.0, method="ipopt").solve(START),
        "aligned": lambda: DirectSolver(problem, horizon=20.0).solve_aligned(START),
        "certified": lambda: solve(problem, START, settings),
        "saddle": lambda: SaddleSolver(problem, horizon=20.0, compiled=False).solve(START),
    }
    with pytest.raises(RunError, match=r"leaves the domain: the speed is -0\.3, but") as caught:
        calls[how]()
    message = one_sentence(caught.value)
    leaves = float(message.split()[1])
    # the first node after the time at which the closed form crosses
    assert abs(optimal_state(leaves)[1]) > LIMIT
    assert abs(optimal_state(leaves - 0.15)[1]) < LIMIT


def test_a_start_outside_the_domain_is_bad_input(one_sentence: Check) -> None:
    problem, outside = integrators(1, limit=LIMIT), np.array([0.0, 0.5])
    policy = ControlPolicy(problem, linear_policy(problem))
    for refuse in (
        DirectSolver(problem).solve,
        SaddleSolver(problem, compiled=False).solve,
        GammaCurveSolver(problem, [2.0], compiled=False).solve,
        WorstCaseSolver(policy).solve,
    ):
        with pytest.raises(InputError, match=r"the speed is 0\.5") as caught:
            refuse(outside)
        one_sentence(caught.value)


def test_bounds_that_are_kept_change_no_bit() -> None:
    free, bounded = integrators(1), integrators(1, limit=2.0)
    for one, other in (
        (DirectSolver(free).solve(START), DirectSolver(bounded).solve(START)),
        (SaddleSolver(free).solve(START), SaddleSolver(bounded).solve(START)),
    ):
        assert one.value == other.value
        np.testing.assert_array_equal(one.costate, other.costate)


def test_responses_outside_the_domain_are_none() -> None:
    """Along a path that is found without the bound."""
    free = integrators(1)
    problem = replace(free, domain=(Bound(0.09 - free.zeta[1] ** 2, "the speed is {}", free.zeta[1]),))
    optimum = DirectSolver(free, horizon=20.0, n_intervals=20).solve(START, verify=False)
    assert BestResponse(free).solve(START, optimum.value, optimum.trajectory).gap < 1e-4
    with pytest.raises(RunError, match="leaves the domain: the speed is"):
        BestResponse(problem).solve(START, optimum.value, optimum.trajectory)


def test_worst_cases_outside_the_domain_are_unbounded() -> None:
    problem = integrators(1, limit=LIMIT)
    policy = ControlPolicy(problem, linear_policy(problem))
    found = WorstCaseSolver(policy, horizon=20.0, n_intervals=20).solve(START)
    assert found.unbounded is not None
    assert "leaves the domain: the speed is" in found.unbounded
    inside = WorstCaseSolver(policy, horizon=20.0, n_intervals=20).solve(0.1 * START)
    assert inside.cost == pytest.approx(0.01 * START @ riccati_by_hand() @ START, rel=1e-4)
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.ones(2))
    p = riccati_by_hand()
    weights = WeightSchedule.constant(np.array([p[0, 0], 2.0 * p[0, 1], p[1, 1]]))
    scheduled = ScheduledWorstCase(problem, basis, horizon=20.0, n_intervals=20).solve(START, weights)
    assert scheduled.unbounded is not None
    assert "leaves the domain" in scheduled.unbounded


def test_a_known_push_and_a_measured_gain_stay_inside() -> None:
    problem = integrators(1, limit=LIMIT)
    u, t = SX.sym("u"), SX.sym("t")
    rate = problem.drift + problem.input_matrix @ u
    Q, R = problem.game.Q, problem.game.R
    known = against_known(problem.zeta, u, t, rate, Q, R, problem.domain)
    with pytest.raises(RunError, match="leaves the domain"):
        ClairvoyantSolver(known, R, 5.0).solve(START, [])
    meter = GainMeter(ControlPolicy(problem, linear_policy(problem)), horizon=20.0)
    assert meter.measure(1e-4).reach < LIMIT
    with pytest.raises(RunError, match="leaves the domain"):
        meter.measure(10.0)


def test_a_level_outside_the_domain_is_a_fault_of_its_point() -> None:
    curve = GammaCurveSolver(integrators(1, limit=LIMIT), [2.0], compiled=False).solve(START)
    assert np.isnan(curve.points[0].value)
    assert any("leaves the domain" in fault for fault in curve.faults)


@pytest.mark.parametrize("how", ["solve", "direct", "saddle", "gamma"])
def test_inputs_that_enter_apart_are_refused(how: str, one_sentence: Check) -> None:
    """g_1 = g_2 is what the single-player equivalent rests on."""
    problem = integrators(1, actuated=False)
    apart = replace(problem, disturbance_matrix=SX(DM([1.0, 0.0])))
    calls: dict[str, Callable[[], object]] = {
        "solve": lambda: solve(apart, START),
        "direct": lambda: DirectSolver(apart),
        "saddle": lambda: SaddleSolver(apart),
        "gamma": lambda: GammaCurveSolver(apart, [2.0]),
    }
    with pytest.raises(InputError, match="different matrices") as caught:
        calls[how]()
    one_sentence(caught.value)
