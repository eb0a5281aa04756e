"""The dissipation inequality as a conservation law, and along disturbed runs of the learner.

Completing the square in the Hamilton-Jacobi-Isaacs equation, for every u_1 and d,

    γ^2 ∫ d'W_d d + V(ζ_0) - ∫ (ζ'Qζ + u_1'R u_1) - V(ζ(T)) = γ^2 ∫ |d - d*|^2_Wd - ∫ |u_1 - u_1*|^2_R,

with u_1* = -1/2 R^-1 g'V_ζ' and d* = 1/2 γ^-2 W_d^-1 g'V_ζ' of (8)(9): nothing is left over.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import dissipation_margin
from stationkeep.offline import DirectSolver, QuickValue
from stationkeep.online import build_disturbance, draw_samples, run, to_dataset
from stationkeep.online.loop import PlantState
from stationkeep.online.vehicle import HeldPlant
from stationkeep.symbolic import Problem

from .games import HALF_WIDTHS, Array, linear_on, linear_quadratic, quick_scenario, two_state

Gradient = Callable[[Array], Array]


def quadratic_form(x: Array, weight: Array) -> float:
    return float(x @ weight @ x)


def balance(
    problem: Problem, V_zeta: Gradient, zeta0: Array, miss: float
) -> tuple[Array, Array, float]:
    """Integrate spent, supplied and the right-hand side along u_1 = u_1* + miss sin and a seeded d.

    Returns the last state, (spent, supplied) and the right-hand side.
    """
    game, n, k = problem.game, problem.n_states, problem.n_inputs
    rates = casadi.Function("rates", [problem.zeta], [problem.drift, problem.input_matrix])
    rng = np.random.default_rng(3)
    amplitude, frequency = rng.uniform(-2.0, 2.0, (2, k)), rng.uniform(0.3, 2.0, (2, k))

    def flow(t: float, y: Array) -> Array:
        f, g = (np.asarray(part) for part in rates(y[:n]))
        u_star, d_star = game.policies(g, V_zeta(y[:n]))
        u = u_star + miss * amplitude[0] * np.sin(frequency[0] * t)
        d = amplitude[1] * np.cos(frequency[1] * t)
        spent = quadratic_form(y[:n], game.Q) + quadratic_form(u, game.R)
        supplied = game.gamma**2 * quadratic_form(d, game.W_d)
        square = game.gamma**2 * quadratic_form(d - d_star, game.W_d) - quadratic_form(
            u - u_star, game.R
        )
        return np.concatenate([f.ravel() + g @ (u + d), [spent, supplied, square]])

    y0 = np.append(zeta0, np.zeros(3))
    end = solve_ivp(flow, (0.0, 4.0), y0, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    return end[:n], end[n : n + 2], float(end[-1])


def as_record(spent: float, supplied: float) -> xr.Dataset:
    return xr.Dataset({"cost": ("time", [0.0, spent]), "attenuated": ("time", [0.0, supplied])})


@pytest.mark.parametrize("miss", [0.0, 1.0])
def test_nothing_is_lost_in_the_linear_quadratic_game(miss: float) -> None:
    """V = ζ'P ζ in twelve states; with u_1 = u_1* the margin is γ^2 ∫ |d - d*|^2 and positive."""
    problem = linear_quadratic()[0]
    P, zeta0 = problem.P, 0.5 * HALF_WIDTHS
    end, (spent, supplied), square = balance(problem, lambda zeta: 2.0 * P @ zeta, zeta0, miss)
    margin = dissipation_margin(as_record(spent, supplied), zeta0 @ P @ zeta0, end @ P @ end)
    assert margin == pytest.approx(square, rel=1e-8)
    assert (square > 0.0) or miss


@pytest.mark.parametrize("miss", [0.0, 1.0])
def test_nothing_is_lost_in_the_exact_nonlinear_game(miss: float) -> None:
    """V = ζ_1^2 / 2 + ζ_2^2."""

    def value(zeta: Array) -> float:
        return float(zeta[0] ** 2 / 2.0 + zeta[1] ** 2)

    zeta0 = np.array([1.0, -1.5])
    end, (spent, supplied), square = balance(
        two_state()[0], lambda zeta: np.array([zeta[0], 2.0 * zeta[1]]), zeta0, miss
    )
    margin = dissipation_margin(as_record(spent, supplied), value(zeta0), value(end))
    assert margin == pytest.approx(square, rel=1e-9)
    assert (square > 0.0) or miss


def test_nothing_is_lost_along_a_run_in_a_current() -> None:
    """The linear policy's held wrenches, V and V_ζ from the direct solve at the nodes of each hold."""
    period, scenario = (
        0.1,
        quick_scenario(
            "simulation.mode=disturbed",
            "simulation.disturbance={kind='current', velocity=[0.2, -0.1, 0.05]}",
            "simulation.control_period=0.1",
            "simulation.duration=1",
        ),
    )
    station, game = scenario.station_keeping(), scenario.station_keeping().game
    history = run(scenario, linear_on(station))
    solver = DirectSolver(station.problem, horizon=60.0, n_intervals=24, degree=6, grading=6.0)
    plant = HeldPlant(station, build_disturbance(scenario.simulation.disturbance))
    nodes, weights = np.polynomial.legendre.leggauss(3)
    square = 0.0
    for start, zeta, tau_b in zip(history.time[:-1], history.zeta, history.tau_b, strict=False):
        for node, weight in zip(nodes, weights, strict=True):
            dt = 0.5 * period * (1.0 + node)
            now = plant.advance(start, PlantState(zeta, 0.0, 0.0), tau_b, np.zeros(6), dt).zeta
            _, u, d = plant.rates(start + dt, now, tau_b, np.zeros(6))
            costate = solver.solve(now, verify=False).costate
            u_star, d_star = game.policies(station.model.input_matrix(now), costate)
            gap = game.gamma**2 * quadratic_form(d - d_star, game.W_d)
            square += 0.5 * period * weight * (gap - quadratic_form(u - u_star, game.R))
    ends = [solver.solve(history.zeta[i], verify=False).value for i in (0, -1)]
    assert dissipation_margin(to_dataset(history, {}), *ends) == pytest.approx(square, rel=1e-5)
    assert square > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["current", "waves"])
def test_dissipation_of_the_learner(kind: str) -> None:
    """Margins are positive from rest, from the shipped start and from the far envelope."""
    shipped = Scenario.load("bluerov2-heavy")
    station = shipped.station_keeping()
    value = QuickValue(station.problem)
    starts = [np.zeros(12), shipped.initial_state, draw_samples(station.half_widths, 1, 5)[0]]
    for seed, start in enumerate(starts):
        disturbance = {
            "kind": kind,
            "velocity": [(0.1, 0.1, 0.0), (-0.2, 0.1, 0.0), (0.1, -0.25, 0.05)][seed],
            "wave_height": [0.1, 0.3, 0.5][seed],
            "seed": seed,
        }
        changes = {"initial_state": tuple(start), "mode": "disturbed", "duration": 15.0}
        history = run(shipped.with_settings(simulation=changes | {"disturbance": disturbance}))
        assert history.stopped is None
        supplied, V_start = history.attenuated[-1], value(start)
        margin = dissipation_margin(to_dataset(history, {}), V_start, value(history.zeta[-1]))
        assert margin > 0.2 * (supplied + V_start)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["game", "disturbed"])
def test_no_start_of_the_envelope_is_lost(mode: str) -> None:
    """Eight random states at s = 1 and eight corners, in the game and in waves."""
    shipped = Scenario.load("bluerov2-heavy")
    states = draw_samples(HALF_WIDTHS, 8, 3)
    corners = HALF_WIDTHS * np.random.default_rng(3).choice([-1.0, 1.0], (8, 12))
    for seed, state in enumerate(np.vstack([states, corners])):
        waves = {"kind": "waves" if mode == "disturbed" else "none", "seed": seed}
        changes = {"initial_state": tuple(state), "mode": mode, "duration": 6.0, "disturbance": waves}
        history = run(shipped.with_settings(simulation=changes))
        assert history.stopped is None
        assert np.linalg.norm(history.zeta[-1] / HALF_WIDTHS) < np.linalg.norm(state / HALF_WIDTHS)
