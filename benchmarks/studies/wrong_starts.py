"""What becomes of wrong starts: the second table of the script `regret.py`, see there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import Regret, regret
from stationkeep.comparison.records import closed_loop
from stationkeep.comparison.study.excitation import PLAIN, excitation_run
from stationkeep.offline import QuickValue
from stationkeep.offline.path import MeshSettings
from stationkeep.online import draw_samples
from stationkeep.symbolic import Basis, Problem, ValueFunctions, quadratic
from stationkeep.symbolic.arrays import Array

from .cases import Case, Row, regrets
from .kept import Keep
from .lesson import Lesson, lesson
from .recovery import (
    WATCHED,
    WITHIN,
    half_added_mass,
    rank_and_margin,
    recoveries,
    regressors,
    remembered_regret,
    time_within,
)

Keeper = Callable[[str], Keep]
TIMES = (0.0, 1.0, 5.0, 20.0, 60.0)  # s
HEADER = """
wrong starts, {n} states at s = {scale:g}; regret above V* in %: median / 90 % / max
  reference  of leash, projection and safeguard: the right P, or the start itself
  before     median regret of the start if nothing were learned, as the model predicts it
  online     learning from this start, scored while it learns
  lesson     one learning run from a state that is not scored, whose weights are remembered
  frozen     fresh runs with the remembered weights, without learning
  again      fresh runs that learn on from the remembered weights
  t frozen   time [s] after which the lesson's weights, frozen, have a predicted median within
             {within:g} x the right start's in the end
  t online   time [s] after which the regret of the policy in use stays within {within:g} x that of a
             learner that started right and saw the same states, until {watched:g} s: median / max
{start:<20}{reference:<11}{before:>8}{online:>23}{lesson:>8}{frozen:>23}{again:>23}\
{failed:>8}{tf:>10}{to:>13}"""


def wrong_starts(scenario: Scenario, folder: Path) -> dict[str, dict[str, Any]]:
    """Return the settings of every start but zero, the right one first."""
    vehicle = scenario.station_keeping().model.vehicle
    other = half_added_mass(vehicle, folder).resolve()
    return {
        "P": {},
        "P / 2": {"weight_factor": 0.5},
        "P, half added mass": {"weights_vehicle": str(other)},
    }


def print_starts(scenario: Scenario, states: Array, start: Array, folder: Path, keeper: Keeper) -> None:
    """Print, for every start and reference, what learning reaches and when."""
    names = ("start", "reference", "before", "online", "lesson", "frozen", "again", "failed")
    words = {name: name for name in names} | {"tf": "t frozen", "to": "t online"}
    scale, n = scenario.envelope.scale, len(states)
    print(HEADER.format(n=n, scale=scale, within=WITHIN, watched=WATCHED, **words), flush=True)
    optimum = QuickValue(scenario.station_keeping().problem, MeshSettings.fine)
    optima = np.array([optimum(zeta) for zeta in states])
    limit = np.inf
    for name, settings in wrong_starts(scenario, folder).items():
        for reference in ("riccati",) if name == "P" else ("riccati", "initial"):
            what, learner = f"{name}, {reference}", settings | {"reference": reference}
            first = Case("online", changes={"learner": learner})
            taught = lesson(scenario, first, start, folder)
            predicted = remembered_regret(scenario, taught, states, optima)
            limit = WITHIN * predicted[-1] if name == "P" else limit
            found = regrets(scenario, [first, *fresh(taught, reference)], states, keeper(what))
            followed = recoveries(scenario, first, states, keeper(f"{what}, recovery"))
            shown = {case: shares(rows) for case, rows in found.items()}
            failed = sum(not np.isfinite(row.regret) for rows in found.values() for row in rows)
            seconds = [one.seconds for one in followed]
            before = Regret.of(one.before for one in followed).median
            print(
                f"{name:<20}{reference:<11}{100 * before:8.2f}"
                f"{shown['online']:>23}{100 * (regret(taught.cost, optimum(start)) or 0.0):8.3f}"
                f"{shown['frozen']:>23}{shown['again']:>23}{failed:>8}"
                f"{time_within(taught.times, predicted, limit):10.0f}"
                f"{np.median(seconds):6.2f} /{np.max(seconds):5.2f}",
                flush=True,
            )


def fresh(taught: Lesson, reference: str) -> list[Case]:
    """Return what is run with a lesson's weights; they are the reference where P is not known."""
    changes = {"learner": {"weights": str(taught.path.resolve()), "reference": reference}}
    return [Case("frozen", changes=changes, learn=False), Case("again", changes=changes)]


def shares(rows: list[Row]) -> str:
    """Return median, 90 % quantile and maximum of the regret in percent."""
    one = Regret.of(row.regret for row in rows)
    return " / ".join(f"{100 * value:.3f}" for value in (one.median, one.p90, one.max))


def zero_cases() -> dict[str, Case]:
    """Return what is tried from zero weights, by the basis' name and what holds them."""
    zero: dict[str, Any] = {"weight_factor": 0.0}
    bellman = {"error": "bellman", "safeguard": False, "leash": 0.0}
    slow = {"gain_actor_1": 2.0, "gain_actor_2": 2.0, "forgetting": 2.0}
    ways = {
        "costate, safeguard": ("learned", zero),
        "costate, nothing holds": ("learned", zero | {"safeguard": False, "leash": 0.0}),
        "Bellman, nothing holds": ("learned", zero | bellman | slow),
        "gradient as printed": ("gradient", zero),
    }
    return {
        name: Case(name, policy, changes={"learner": learner})
        for name, (policy, learner) in ways.items()
    }


def print_zero(scenario: Scenario, states: Array, keeper: Keeper) -> None:
    """Print what becomes of zero weights, which are not an admissible start."""
    for basis in ("quadratic", scenario.basis.name):
        there = scenario.with_settings(basis={"name": basis})
        m = there.station_keeping().basis.n_basis
        print(
            f"\nzero weights, basis '{basis}': regret of {len(states)} states in %; rank of (18) "
            f"(of {m}) and its margin at the samples, along the run from the scenario's initial state\n"
            f"{'learns from':<24}{'median / 90 % / max':>27}{'failed':>8}"
            + "".join(f"{f't = {t:g} s':>16}" for t in TIMES),
            flush=True,
        )
        cases = zero_cases()
        found = regrets(there, list(cases.values()), states, keeper(f"zero, {basis}"))
        for name, case in cases.items():
            failed = sum(not np.isfinite(row.regret) for row in found[name])
            ranks = "".join(f"{text:>16}" for text in rank_along(there, case))
            print(f"{name:<24}{shares(found[name]):>27}{failed:>8}{ranks}", flush=True)
    print_linearised(scenario)


def rank_along(scenario: Scenario, case: Case) -> list[str]:
    """Return rank and margin of (18) at the fixed samples, under the actors of TIMES."""
    one, station = case.scenario(scenario), scenario.station_keeping()
    history = closed_loop(one, case.make(one))
    points = draw_samples(
        station.envelope, one.samples.number, one.samples.seed, inner=one.samples.inner
    )
    texts = []
    for t in TIMES:
        if t > history.time[-1] + 1e-9:
            texts.append("lost")
            continue
        step = int(np.searchsorted(history.learn_time, t - 1e-9))
        actor = history.actor_1[min(step, len(history.actor_1) - 1)]
        texts.append(told(station.problem, station.basis, station.functions, points, actor))
    return texts


def told(problem: Problem, basis: Basis, functions: ValueFunctions, points: Array, actor: Array) -> str:
    """Return rank and margin of (18) as text."""
    rank, margin = rank_and_margin(regressors(problem, basis, functions, points, actor))
    return f"{rank} ({margin:.1e})"


def print_linearised(scenario: Scenario) -> None:
    """Print what least squares makes of zero weights where P is the answer: the linearised vehicle."""
    station = scenario.station_keeping()
    problem = station.problem.linearized()
    basis = Basis.build("quadratic", quadratic, problem.zeta, station.half_widths)
    functions, P = ValueFunctions(problem, basis), basis.quadratic_weights(problem.P)
    points = draw_samples(station.envelope, 300, scenario.samples.seed)
    print("\nlinearised vehicle, 78 quadratic monomials, 300 samples, Bellman error, nothing holds:")
    for name, factor in (("zero", 0.0), ("P / 2", 0.5)):
        settings = scenario.learner.model_copy(update=PLAIN | {"weight_factor": factor})
        one = excitation_run(
            name, problem, basis, settings, points, scenario.initial_state, P, duration=30.0
        )
        print(
            f"  from {name:<6} rank (margin) of (18) at first "
            f"{told(problem, basis, functions, points, factor * P)}, |W - P| / |P| after "
            f"{one.time[-1]:g} s {one.weight_error[-1]:.1e}; {one.stopped or 'not lost'}",
            flush=True,
        )
