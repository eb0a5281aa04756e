"""What the paper's theory says of runs, printed: (18) along them, the theorem's constants, and ε = 0.

python benchmarks/theory.py [--states 300] [--held-out 75] [--cache DIR]
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from stationkeep.comparison import Condition, Scenario
from stationkeep.comparison.optima import HELD_OUT, Bounds, Ideal, fit
from stationkeep.comparison.policies import contender
from stationkeep.comparison.records import contender_record
from stationkeep.comparison.study.analysis import optimal_pairs
from stationkeep.comparison.study.game_run import game_run
from stationkeep.comparison.theory import run_conditions, scenario_conditions, theory
from stationkeep.comparison.theory.exact_basis import exact_bound
from stationkeep.comparison.theory.uub import Gains, Knowledge, constants, distance, lyapunov, measure
from stationkeep.offline import Pairs, QuickValue
from stationkeep.online import Learner, LearnerSettings, draw_samples, rank_margin
from stationkeep.online.paper import BellmanTerms, bellman_error
from stationkeep.symbolic import Basis, ValueFunctions, quadratic, two_state_game

POLICIES = ("learned", "quadratic", "gradient")


def margins(folder: Path) -> None:
    """Print (18) at the fixed samples along every shipped scenario's runs."""
    print("(18) at the fixed samples along the run, and what the critic learns from")
    print(
        f"  {'scenario':24}{'policy':11}{'m':>4}{'c_lower':>10}{'c_upper':>9}{'|w|':>7}{'decided':>13}"
    )
    for name in Scenario.shipped():
        for policy in POLICIES:
            record = contender_record(Scenario.load(name), policy, folder / f"{name}-{policy}.nc")
            rank = record["row_rank"].values
            print(
                f"  {name:24}{policy:11}{record.sizes['basis']:4}"
                f"{float(record['rank_margin'].min()):10.2e}{float(record['rank_bound'].max()):9.0f}"
                f"{float(record['regressor'].max()):7.1f}{int(rank.min()):7} to{int(rank.max()):4}"
                + (f"   {record.attrs['stopped']}" if record.attrs["stopped"] else "")
            )


def ideal_weights(scenario: Scenario, n_states: int, held_out: int) -> Ideal:
    """Return ideal weights fitted to optima of the envelope, with their errors at others."""
    station, seed = scenario.station_keeping(), scenario.simulation.seed
    value = QuickValue(station.problem)
    training = optimal_pairs(station, value, n_states, seed)
    others = optimal_pairs(station, value, held_out, seed, HELD_OUT)
    found = fit(station, training, others)
    pairs = Pairs(
        np.vstack([training.states, others.states]),
        np.append(training.values, others.values),
        np.vstack([training.gradients, others.gradients]),
    )
    bounds = Bounds(found.epsilon.sup, found.epsilon_prime.sup, len(others.values))
    return Ideal(found.weights, pairs, bounds)


def conditions(scenario: Scenario, ideal: Ideal, policy: str, folder: Path) -> None:
    """Print what the theorem says of one policy's run."""
    changed = contender(policy).changed(scenario)
    record = contender_record(scenario, policy, folder / f"bluerov2-heavy-{policy}.nc")
    margin = float(record["rank_margin"].min())
    rows = scenario_conditions(changed, ideal.bounds, margin)
    rows += run_conditions(changed, record, theory(changed, record, ideal))
    print(f"\nThe theorem and the run of '{contender(policy).label}'")
    for row in rows:
        if row.paper not in ("Assumption 1", "Assumption 2", "Property 1"):
            show(row)


def show(row: Condition) -> None:
    """Print a condition."""
    words = {True: "yes", False: "NO", None: "?"}
    value, bound = ("-" if x is None else f"{x:.3g}" for x in (row.value, row.bound))
    print(f"  {row.name} [{row.paper}]: {value} against {bound}: {words[row.holds]}\n      {row.note}")


def two_state() -> None:
    """Print the UUB claim where ε = 0: K as printed, and the level from which Z converges."""
    problem, W = two_state_game(), np.array([0.5, 0.0, 1.0])
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.ones(2))
    functions, samples = ValueFunctions(problem, basis), draw_samples(np.ones(2), 100, 0)
    gains, ball = Gains(1.0, 3.0, 2.0), float(np.linalg.norm(W)) * (1.0 + 1.1 * 3.0)
    near, chi = disc(0.2), disc(1.0)
    terms = BellmanTerms.at(samples, functions.at(samples), problem.game)
    errors = np.random.default_rng(0).standard_normal((500, 2, 3))
    c_lower = min(
        rank_margin(bellman_error(terms, problem.game, W, W - a, W - b).omega)
        for a, b in 0.1 * errors / np.linalg.norm(errors, axis=2, keepdims=True)
    )
    known = Knowledge(W, chi, chi**2 @ np.array([0.5, 1.0]), chi * np.array([1.0, 2.0]))
    found = constants(measure(functions, known, samples), gains, c_lower, ball)
    exact = exact_bound(functions, near, samples, gains, c_lower)
    print("\nThe exact two-state game, (19)-(21) as printed, 100 samples, ε = 0")
    print(
        f"  (25): c_lower = {c_lower:.3g} > {0.5 * (gains.actor_1 + gains.actor_2):g}; α_5 = "
        f"{found.alpha_5:.3g}; K printed {found.radius_printed:.3g}, corrected {found.radius:.3g}, "
        f"{found.parts['κ_c'] / sum(found.parts.values()):.1%} of K^2 from κ_c (projection's ball)"
    )
    print(f"  with what the terms depend on: V_L_dot < 0 while V_L < {exact.level:.3g}, so Z -> 0")
    starts = [0.015 * np.array([0.6, -0.6, 0.6]), np.array([0.4, 0.3, 0.5]), np.array([2.5, 1.0, 0.0])]
    for error, reach in zip(starts, (0.02, 0.7, 0.7), strict=True):
        for disturbed in (True, False):
            settings = LearnerSettings.as_printed(
                gain_actor_1=gains.actor_1, gain_actor_2=gains.actor_2
            )
            learner = Learner(problem, basis, settings, samples, W, W + error, functions)
            run = game_run(learner, reach * np.array([1.0, -1.0]), 10.0, 0.01, disturbed=disturbed)
            apart = run.errors(W)
            V_L = lyapunov(run.zeta**2 @ np.array([0.5, 1.0]), apart)
            print(
                f"  {'u_1 + u_2' if disturbed else 'd = 0    '}: V_L {V_L[0]:9.2e} to {V_L[-1]:.2e}, "
                f"{int(np.sum(np.diff(V_L) >= 0.0))} of {len(V_L) - 1} steps rise; |Z| ends at "
                f"{distance(run.zeta, apart)[-1]:.1e}"
            )


def disc(radius: float) -> np.ndarray:
    """Return seeded points of the disc, with its edge."""
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    edge = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([radius * part * edge for part in (1.0, 0.7, 0.4, 0.1)])


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--states", type=int, default=300)
    parser.add_argument("--held-out", type=int, default=75)
    parser.add_argument("--cache", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) if options.cache is None else options.cache
        two_state()
        margins(folder)
        scenario = Scenario.load()
        ideal = ideal_weights(scenario, options.states, options.held_out)
        for policy in ("learned", "gradient"):
            conditions(scenario, ideal, policy, folder)


if __name__ == "__main__":
    main()
