"""Error of the collocated value against mesh size: order on smooth games, and what drag's kinks do.

    python benchmarks/offline/collocation.py

The two-state game and the linear-quadratic game have closed-form values, exact for any horizon as the
terminal cost is the value itself. The reference game starts from (2, -1, 1, .3, -.2, 1, 0, ...), where
two velocities change sign, and from a fast state of the envelope, with a horizon of 120 s; its
reference value comes from the finest aligned mesh. Drag |ν|ν is only C^1 where a velocity changes sign.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.offline import DirectSolver
from stationkeep.symbolic import Problem, two_state_game

REFERENCE_STATE = np.array([2.0, -1.0, 1.0, 0.3, -0.2, 1.0, 0, 0, 0, 0, 0, 0])


def order(title: str, problem: Problem, zeta: np.ndarray, value: float, degree: int) -> None:
    """Print error against intervals on a uniform mesh, and the slope of its logarithm."""
    sizes = (8, 16, 32, 64)
    errors = []
    for n_intervals in sizes:
        solver = DirectSolver(problem, horizon=4.0, n_intervals=n_intervals, degree=degree, grading=0.0)
        rest = solver.solve(zeta, verify=False)
        errors.append(abs(rest.value - value) / value)
    resolved = [i for i, error in enumerate(errors) if error > 1e-11]
    slope = -np.polyfit(np.log(np.array(sizes)[resolved]), np.log(np.array(errors)[resolved]), 1)[0]
    figures = "  ".join(f"{n}: {e:.1e}" for n, e in zip(sizes, errors, strict=True))
    print(f"{title}, degree {degree}: {figures}  order {slope:.2f} (theory {2 * degree - 1})")


def kinks(title: str, zeta: np.ndarray) -> None:
    """Print the reference game's value error with and without points at the velocity sign changes."""
    problem = Scenario.load().station_keeping().problem
    finest, events = DirectSolver(problem, n_intervals=160).solve_aligned(zeta)
    print(f"\n{title}: V = {finest.value:.9f}, {len(events)} velocity sign changes")
    print(f"{'intervals':>10}{'plain':>12}{'aligned':>12}{'costate plain':>15}{'costate aligned':>17}")
    for n_intervals in (15, 20, 30, 40, 60, 80):
        solver = DirectSolver(problem, n_intervals=n_intervals)
        plain = solver.solve(zeta, verify=False)
        aligned, _ = solver.solve_aligned(zeta)
        values = [abs(s.value - finest.value) / finest.value for s in (plain, aligned)]
        norm = np.linalg.norm(finest.costate)
        costates = [np.linalg.norm(s.costate - finest.costate) / norm for s in (plain, aligned)]
        print(
            f"{n_intervals:>10}{values[0]:>12.1e}{values[1]:>12.1e}{costates[0]:>15.1e}{costates[1]:>17.1e}",
            flush=True,
        )


def main() -> None:
    """Print all studies."""
    two_state = two_state_game()
    zeta = np.array([1.0, -1.5])
    for degree in (2, 3):
        order("two-state game", two_state, zeta, 0.5 * zeta[0] ** 2 + zeta[1] ** 2, degree)
    linear = Scenario.load().station_keeping().problem.linearized()
    start = 0.5 * REFERENCE_STATE
    for degree in (2, 3):
        order("linear-quadratic game", linear, start, float(start @ linear.P @ start), degree)
    kinks("reference game", REFERENCE_STATE)
    half_widths = Scenario.load().station_keeping().half_widths
    fast = half_widths * np.random.default_rng(11).uniform(-1.0, 1.0, 12)
    kinks("a fast state of the envelope (seed 11)", fast)


if __name__ == "__main__":
    main()
