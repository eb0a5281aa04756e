"""Evidence for the offline optimum: certificates, agreement, several extremals, and its speed.

    python benchmarks/offline/optimum.py [--states 50] [--only exact certificates saddle speed]

Prints for each part what is measured; a failed certificate is a row with its reason, not dropped.
Seeds are fixed. Speeds are medians in one process with one thread.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import statistics
import time

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.offline import (
    BestResponse,
    ControlPolicy,
    DirectSolver,
    MeshSettings,
    OfflineSettings,
    OfflineSolver,
    SaddleSolver,
    WorstCaseSolver,
    linear_policy,
)
from stationkeep.symbolic import Problem, two_state_game
from stationkeep.symbolic.arrays import Array

FAR_STATE = np.array([2, -1, 1, 0.3, -0.2, 1, 0, 0, 0, 0, 0, 0], dtype=float)


def reference() -> Problem:
    """Return the shipped game on the neutral BlueROV2 Heavy."""
    return Scenario.load("bluerov2-heavy").station_keeping().problem


def envelope_states(problem: Problem, number: int, seed: int = 0) -> Array:
    """Return seeded states, uniform in the full envelope."""
    rng = np.random.default_rng(seed)
    return problem.scale * rng.uniform(-1.0, 1.0, (number, problem.n_states))


def exact(_: int) -> None:
    """Games whose value is known: two states, and linear-quadratic in twelve."""
    print("Games with a known value: largest error of 100 random states")
    game = two_state_game()
    direct = DirectSolver(game, horizon=40.0, n_intervals=40, degree=6, grading=3.0)
    saddle = SaddleSolver(game, horizon=40.0)
    errors: dict[str, list[tuple[float, float]]] = {"direct (IPOPT)": [], "saddle point": []}
    for zeta in np.random.default_rng(0).uniform(-2.0, 2.0, (100, 2)):
        value, costate = zeta[0] ** 2 / 2 + zeta[1] ** 2, np.array([zeta[0], 2 * zeta[1]])
        for name, found in (
            ("direct (IPOPT)", direct.solve(zeta, verify=False)),
            ("saddle point", saddle.solve(zeta)),
        ):
            gap = float(np.abs(found.costate - costate).max() / np.abs(costate).max())
            errors[name].append((abs(found.value - value) / value, gap))
    for name, pairs in errors.items():
        worst = np.array(pairs).max(axis=0)
        print(f"  two-state game, {name:<22} value {worst[0]:.1e}   costate {worst[1]:.1e}")
    linear = reference().linearized()
    solvers = {
        "direct (Newton)": DirectSolver(linear, horizon=120.0, n_intervals=40, degree=6),
        "direct (IPOPT)": DirectSolver(linear, horizon=120.0, n_intervals=40, degree=6, method="ipopt"),
    }
    states = envelope_states(linear, 100)
    for name, solver in solvers.items():
        gaps = [abs(solver.solve(z, verify=False).value / (z @ linear.P @ z) - 1) for z in states]
        print(f"  LQ game, 12 states, {name:<18} value {max(gaps):.1e}")
    saddle = SaddleSolver(linear)
    gaps = [abs(saddle.solve(z).value / (z @ linear.P @ z) - 1) for z in states]
    print(f"  LQ game, 12 states, {'saddle point':<18} value {max(gaps):.1e}\n")


def certificates(number: int) -> None:
    """Random states of the full envelope, and the symmetric ones."""
    problem = reference()
    solver = OfflineSolver(problem)
    entries: dict[str, list[float]] = {}
    seconds: list[float] = []
    failed = 0
    for i, zeta in enumerate(envelope_states(problem, number)):
        found = solver.solve(zeta)
        seconds.append(found.seconds)
        for name, value in vars(found.certificate).items():
            entries.setdefault(name, []).append(float(value))
        assert found.saddle is not None
        gap = np.linalg.norm((found.costate - found.saddle.costate) * problem.scale)
        size = np.linalg.norm(found.costate * problem.scale)
        entries.setdefault("costate, direct - saddle", []).append(float(gap / size))
        if found.faults:
            failed += 1
            print(f"  state {i} failed: {'; '.join(found.faults)}")
    print(f"Certificates of {number} random states of the full envelope: {failed} failed")
    print(f"  {'':<26}{'median':>10}{'90 %':>10}{'worst':>10}")
    for name, values in entries.items():
        if name in ("second_order", "gradient_unique"):
            print(f"  {name:<26}{sum(v == 1.0 for v in values)} of {number}")
            continue
        quantiles = np.median(values), np.quantile(values, 0.9), np.max(values)
        print(f"  {name:<26}" + "".join(f"{q:>10.1e}" for q in quantiles))
    print(f"  certified solve: median {statistics.median(seconds):.2f} s, worst {max(seconds):.2f} s")
    mirrored(problem, solver)


def mirrored(problem: Problem, solver: OfflineSolver) -> None:
    """Print what is found from symmetric states, beside the game restricted to the axis."""
    print(
        "\nSymmetric states: the extremals found, cheapest first, and how far above it the others are"
    )
    for label, axis, distance in (("surge", 0, 2.0), ("heave", 2, 2.0), ("surge", 0, 3.0)):
        found = solver.solve(distance * np.eye(12)[axis])
        others = [
            f"{(o.value - found.value) / found.value:.2e} ({'minimum' if o.second_order else 'saddle'})"
            for o in found.others
        ]
        print(
            f"  {distance:.0f} m {label}: V = {found.value:.8f}, value error "
            f"{found.certificate.value_error:.1e}, gradient unique: "
            f"{found.certificate.gradient_unique}; others: {', '.join(others) or 'none'}"
        )


def saddle(_: int) -> None:
    """Best responses of both players to the other's feedback, and the linear policy's worst case."""
    problem = reference()
    direct = DirectSolver(problem)
    best = BestResponse(problem)
    worst = WorstCaseSolver(ControlPolicy(problem, linear_policy(problem)))
    print(
        "\nSaddle from both sides, relative to V, and the linear policy against its worst disturbance"
    )
    print(f"  {'':<4}{'V':>10}{'upper - V':>12}{'V - lower':>12}{'strict':>8}", end="")
    print(f"{'worst cost above V':>20}{'re-integrated':>15}")
    for i, zeta in enumerate(envelope_states(problem, 10)):
        solution, _ = direct.solve_aligned(zeta, verify=False)
        value = solution.value
        found = best.solve(zeta, value, solution.trajectory)
        case = worst.solve(zeta)
        print(
            f"  {i:<4}{value:>10.3f}{found.upper / value - 1:>12.1e}{1 - found.lower / value:>12.1e}"
            f"{found.holds!s:>8}",
            end="",
        )
        if case.unbounded is None:
            print(f"{100 * case.excess(value):>18.2f} %{abs(case.reintegrated / case.cost - 1):>15.1e}")
        else:
            print(f"  unbounded: {case.unbounded}")
    print(f"  L2 gain of the linear policy, linearised: {worst.policy.l2_gain:.6f} (gamma is 2)")


def speed(_: int) -> None:
    """A re-solve from a new state on a coarse mesh, by both methods, and a certified one."""
    problem = reference()
    states = envelope_states(problem, 100, seed=1)
    fine = DirectSolver(problem, horizon=120.0, n_intervals=80, degree=6)
    truth = [fine.solve_aligned(zeta, verify=False)[0].value for zeta in states]
    print(f"\nRe-solve from 100 new states, {MeshSettings.quick}")
    print(f"  {'':<18}{'build [s]':>10}{'median [ms]':>13}{'worst [ms]':>12}{'states/s':>10}", end="")
    print(f"{'median error':>14}{'worst error':>13}")
    for method in ("newton", "ipopt"):
        started = time.perf_counter()
        solver = DirectSolver(problem, MeshSettings.quick, method=method)  # type: ignore[arg-type]
        solver.solve(0.5 * states[0], verify=False)
        build = time.perf_counter() - started
        seconds, errors = [], []
        for zeta, exact_value in zip(states, truth, strict=True):
            found = solver.solve(zeta, verify=False)
            seconds.append(found.seconds)
            errors.append(abs(found.value / exact_value - 1.0))
        print(
            f"  {method:<18}{build:>10.2f}{1e3 * statistics.median(seconds):>13.1f}"
            f"{1e3 * max(seconds):>12.1f}{len(states) / sum(seconds):>10.0f}"
            f"{statistics.median(errors):>14.1e}{max(errors):>13.1e}"
        )
    for method in ("newton", "ipopt"):
        certified = OfflineSolver(problem, OfflineSettings(method=method))  # type: ignore[arg-type]
        times = [certified.solve(zeta).seconds for zeta in states[:10]]
        print(f"  certified, {method:<8} median {statistics.median(times):.2f} s of 10 states")


PARTS = {"exact": exact, "certificates": certificates, "saddle": saddle, "speed": speed}


def main() -> None:
    """Run the chosen parts."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--states", type=int, default=50)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    options = parser.parse_args()
    for part in options.only:
        PARTS[part](options.states)


if __name__ == "__main__":
    main()
