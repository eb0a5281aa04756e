"""The saddle point beside the direct solution, gamma* by two routes, and the value against gamma.

    python benchmarks/offline/saddle.py

States are random in the whole envelope of the default scenario. Both solves align their mesh with the
velocity sign changes of their own trajectory.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import time

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.offline import DirectSolver, GammaCurveSolver, SaddleSolver
from stationkeep.symbolic import Problem, gamma_hamiltonian, gamma_star

N_STATES = 60


def agreement(problem: Problem) -> None:
    """Print how far value and costate of both solves are apart, and what the saddle point takes."""
    saddle, direct = SaddleSolver(problem), DirectSolver(problem)
    rows = []
    for zeta in problem.scale * np.random.default_rng(2024).uniform(-1.0, 1.0, (N_STATES, 12)):
        started = time.perf_counter()
        found, _ = saddle.solve_aligned(zeta)
        seconds = time.perf_counter() - started
        optimum, _ = direct.solve_aligned(zeta)
        gap = np.linalg.norm((found.costate - optimum.costate) * problem.scale)
        gap /= np.linalg.norm(optimum.costate * problem.scale)
        value = abs(found.value - optimum.value) / optimum.value
        rows.append([value, gap, seconds, found.iterations])
    middle, worst = np.median(rows, axis=0), np.max(rows, axis=0)
    for i, name in enumerate(("value gap", "costate gap", "seconds", "Newton steps")):
        print(f"saddle and direct, {N_STATES} states, {name}: {middle[i]:.2g}, at most {worst[i]:.2g}")


def attenuation(problem: Problem) -> None:
    """Print gamma* by both routes for the scenario's game, the paper's W_d = I, and a damped chain."""
    (A, B), game, n = problem.linearization, problem.game, 3
    links = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    damped = np.block([[np.zeros((n, n)), np.eye(n)], [-3.0 * links, -0.4 * links]])
    push = np.vstack([np.zeros((n, n)), np.eye(n)])
    for name, matrices in (
        ("scenario", (A, B, game.Q, game.R, game.W_d)),
        ("W_d = I", (A, B, game.Q, game.R, np.eye(6))),
        ("damped chain, R = 4 I", (damped, push, np.eye(2 * n), 4.0 * np.eye(n), np.eye(n))),
    ):
        routes = gamma_star(*matrices), gamma_hamiltonian(*matrices)
        print(f"gamma*, {name}: {routes[0]:.9f} by Riccati, {routes[1]:.9f} by eigenvalues")


def curve(problem: Problem, zeta: np.ndarray) -> None:
    """Print the value against gamma and the largest gap of its slope to central differences."""
    levels = np.array([1.05, 1.2, 1.5, 2.0, 3.0, 5.0])
    started = time.perf_counter()
    found = GammaCurveSolver(problem, levels).solve(zeta)
    seconds = time.perf_counter() - started
    h = 1e-4 * (levels - 1.0)
    values = [
        [point.value for point in GammaCurveSolver(problem, near).solve(zeta).points]
        for near in (levels + h, levels - h)
    ]
    for point, ahead, behind, step in zip(found.points, *values, h, strict=True):
        difference = (ahead - behind) / (2.0 * step)
        print(
            f"gamma {point.gamma:g}: V {point.value:.6f}, linear {point.linear_value:.6f}, slope "
            f"{point.slope:.6f}, by differences {difference:.6f}"
        )
    print(f"without disturbance: V {found.undisturbed.value:.6f}; {seconds:.2f} s in all")


if __name__ == "__main__":
    SCENARIO = Scenario.load()
    PROBLEM = SCENARIO.station_keeping().problem
    agreement(PROBLEM)
    attenuation(PROBLEM)
    curve(PROBLEM, SCENARIO.initial_state)
