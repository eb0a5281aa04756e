"""The figures behind the claims on model and learner, printed; the tests assert the same with bounds.

python benchmarks/evidence.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import casadi
import numpy as np
from casadi import SX
from stationkeep.comparison import Scenario
from stationkeep.online import Learner, LearnerSettings, draw_samples
from stationkeep.online.learning import PERIOD
from stationkeep.online.paper import BellmanTerms, bellman_error
from stationkeep.symbolic import (
    Basis,
    Model,
    Problem,
    ValueFunctions,
    Vehicle,
    quadratic,
    two_state_game,
)
from stationkeep.symbolic.underwater import earth_frame, jacobian, jacobian_inverse

RNG = np.random.default_rng(0)


def model() -> None:
    """Print the identities of the earth-frame model, worst of 1,000 random states."""
    zeta = SX.sym("zeta", 12)
    for name in ("bluerov2-heavy", "bluerov2-heavy-buoyant", "rexrov"):
        vehicle = Vehicle.load(name)
        terms = earth_frame(vehicle, zeta[:6], zeta[6:])
        rate = casadi.jtimes(terms.M_bar, zeta[:6], zeta[6:])
        gap = rate - 2 * terms.C_bar
        unit = jacobian(zeta[:6]) @ jacobian_inverse(zeta[:6]) - SX.eye(6)
        checks = [
            casadi.norm_fro(gap + gap.T) / casadi.norm_fro(rate),
            casadi.norm_fro(unit),
        ]
        function = casadi.Function("checks", [zeta], checks)
        states = RNG.uniform(-1.2, 1.2, (1000, 12))
        worst = np.max([[float(value) for value in function(state)] for state in states], axis=0)
        still = Model(vehicle)
        residual = still.drift(np.zeros(12)) + still.input_matrix(np.zeros(12)) @ still.u_trim
        print(
            f"{name}: M_bar_dot - 2 C_bar skew to {worst[0]:.1e}, J J^-1 = I to {worst[1]:.1e}, "
            f"f(0) + g(0) u_trim = {np.abs(residual).max():.1e}"
        )


def two_state() -> None:
    """Print what both laws reach on the exact two-state game, and identity (22)."""
    problem, ideal = two_state_game(), np.array([0.5, 0.0, 1.0])
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.ones(2))
    samples, start = draw_samples(problem.scale, 30, 0), np.array([0.9, 0.3, 1.5])
    for rule in ("gradient", "least_squares"):
        settings = LearnerSettings.as_printed(rule=rule, forgetting=2.0)
        learner = Learner(problem, basis, settings, samples, ideal, start)
        for _ in range(400):
            learner.step(np.array([0.5, 0.5]), PERIOD)
        print(f"two-state game, {rule}: |W - W*| = {np.abs(learner.critic - ideal).max():.1e}")
    points = RNG.uniform(-2.0, 2.0, (200, 2))
    terms = BellmanTerms.at(points, ValueFunctions(problem, basis).at(points), problem.game)
    critic, actor_1, actor_2 = ideal + RNG.standard_normal((3, 3))
    found = bellman_error(terms, problem.game, critic, actor_1, actor_2)
    errors = [terms.sigma_g @ (ideal - actor) for actor in (actor_1, actor_2)]
    weights = (problem.game.R_inverse, problem.game.disturbance_inverse)
    squares = [np.sum((e @ w) * e, axis=1) for e, w in zip(errors, weights, strict=True)]
    expected = -found.omega @ (ideal - critic) + 0.25 * squares[0] - 0.25 * squares[1]
    gap = np.abs(found.delta - expected).max() / np.abs(found.delta).max()
    print(f"two-state game, identity (22): {gap:.1e} relative")


def linear_quadratic() -> None:
    """Print the Bellman error of exact weights, and what least squares finds from P/2."""
    station = Scenario.load().station_keeping()
    undamped = {"linear_damping": [0.0] * 6, "quadratic_damping": [0.0] * 6}
    vehicle = station.model.vehicle.model_copy(update=undamped)
    problem: Problem = Model(vehicle).problem(station.game, station.half_widths).linearized()
    basis = Basis.build("quadratic", quadratic, problem.zeta, station.half_widths)
    exact = basis.quadratic_weights(problem.P)
    points = draw_samples(station.half_widths, 400, 1)
    terms = BellmanTerms.at(points, ValueFunctions(problem, basis).at(points), problem.game)
    delta = bellman_error(terms, problem.game, exact, exact, exact).delta
    print(f"LQ game, exact weights: |δ| <= {np.abs(delta / terms.state_cost).max():.1e} ζ'Qζ")
    settings = LearnerSettings.as_printed(
        rule="least_squares", normalizer="state_cost", forgetting=2.0, weight_factor=0.5
    )
    learner = Learner(problem, basis, settings, points, exact)
    for _ in range(200):
        learner.step(0.1 * station.half_widths, PERIOD)
    error = np.linalg.norm(learner.critic - exact) / np.linalg.norm(exact)
    print(f"LQ game, least squares from P/2: |W - W*| / |W*| = {error:.1e}")
    single = Learner(problem.with_game(problem.game.single_player()), basis, settings, points, exact)
    double = Learner(problem, basis, settings, points, exact)
    for _ in range(50):
        for one in (single, double):
            one.step(0.1 * station.half_widths, PERIOD)
    gap = np.linalg.norm(single.critic - double.critic) / np.linalg.norm(exact)
    equal = np.array_equal(double.actor_1, double.actor_2)
    print(f"equal actors stay equal: {equal}; single-player learner with R_eff: {gap:.1e} apart")


if __name__ == "__main__":
    model()
    two_state()
    linear_quadratic()
