"""Learning from weights that are wrong at the start: how long it takes, and (18) from zero weights.

The reference of a learner (of leash, projection and safeguard) is the Riccati solution of the right
model, or, where nothing better is known, what the learner starts from (`learner.reference`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison.merit import Regret, regret
from stationkeep.comparison.parallel import Work
from stationkeep.comparison.records import provenance
from stationkeep.comparison.scenario import Scenario
from stationkeep.offline import QuickValue
from stationkeep.offline.path import MeshSettings
from stationkeep.online import Controller, run
from stationkeep.online.paper import BellmanTerms, bellman_error
from stationkeep.online.records import write_text
from stationkeep.symbolic import Basis, Problem, ValueFunctions, Vehicle
from stationkeep.symbolic.arrays import Array

from .cases import Case, finished
from .kept import Keep, Result, key_of
from .lesson import Lesson

WATCHED = 10.0  # s, until when the policy in use is followed
WITHIN = 1.1  # times the regret of the right start
RESOLVED = 1e-5  # regret below which predictions and V* tell nothing


def half_added_mass(vehicle: Vehicle, folder: Path) -> Path:
    """Write the vehicle with half the added mass as a TOML file, and return its path."""
    wrong = vehicle.model_dump(exclude_none=True)
    wrong["name"] = f"{vehicle.name}, half the added mass"
    wrong["added_mass"] = (0.5 * np.array(vehicle.added_mass)).tolist()
    tables = {key: wrong.pop(key) for key in list(wrong) if isinstance(wrong[key], dict)}
    lines = _toml(wrong)
    for name, table in tables.items():
        lines += [f"[{name}]", *_toml(table)]
    return write_text(folder / "half-added-mass.toml", "\n".join(lines) + "\n")


def _toml(table: dict[str, Any]) -> list[str]:
    return [f"{key} = {json.dumps(value)}" for key, value in table.items()]


def remembered_regret(scenario: Scenario, lesson: Lesson, states: Array, optima: Array) -> Array:
    """Return the median over states of the regret that a lesson's weights have, frozen, (T,).

    As the model predicts it for the policy of the weights alone, without safeguard.
    """
    predicted = Controller(scenario, learn=False).learner.predicted_cost
    medians, before, known = [], None, np.nan
    for weights in lesson.weights:
        if before is None or not np.array_equal(weights, before):
            costs = np.array([predicted(zeta, weights, weights) for zeta in states])
            known = Regret.of(map(regret, costs, optima)).median
        before = weights
        medians.append(known)
    return np.array(medians)


def time_within(times: Array, regrets: Array, limit: float | Array) -> float:
    """Return the time from which on the regrets (T,) stay within the limit; infinite if they don't."""
    outside = np.flatnonzero(~(regrets <= limit))
    if not len(outside):
        return float(times[0])
    last = int(outside[-1])
    return float(times[last + 1]) if last + 1 < len(times) else np.inf


@dataclass(frozen=True)
class Recovery:
    """The policy in use beside one that was learned from the right start, at the same states.

    Attributes
    ----------
    times : (T,) of the learning steps [s]
    wrong, right : (T,) J / V* - 1 after each of them, from where the vehicle is
    before : the same of the wrong start, before it learned at all
    """

    times: Array
    wrong: Array
    right: Array
    before: float

    @property
    def seconds(self) -> float:
        """Time from which on the regret stays within 1.1 times that of the right start [s].

        Up to 1e-5, which is what can be told apart.
        """
        return time_within(self.times, self.wrong, WITHIN * np.maximum(self.right, 0.0) + RESOLVED)


def recoveries(scenario: Scenario, case: Case, states: Array, keep: Keep) -> list[Recovery]:
    """Return the recovery of a case from every row of `states`; the wrong start drives.

    A learner with the scenario's own start is shown the same states, and learns from them too.
    """
    kind = f"recovery {WATCHED}"
    key = provenance(case.scenario(scenario), kind)["key"]
    keys = [key_of(key, provenance(scenario, kind)["key"], zeta.tolist()) for zeta in states]
    found = keep.results(_worker, (scenario, case), list(states), keys)
    return [_recovery(one) for one in found]


def _recovery(result: Result) -> Recovery:
    if result.get("failure") or result["stopped"]:
        return Recovery(np.zeros(1), np.full(1, np.inf), np.zeros(1), np.inf)
    times, wrong, right = (np.array(result[name]) for name in ("times", "wrong", "right"))
    return Recovery(times, wrong, right, result["before"])


class _Beside:
    """One controller drives, another one sees the same and learns too."""

    def __init__(self, driving: Controller, other: Controller) -> None:
        self.driving, self.other = driving, other
        self.u_disturbance = driving.u_disturbance
        self.seen: list[tuple[Array, float, float]] = []
        self.times: list[float] = []
        self._t = 0.0

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        tau_b = self.driving.step(eta, eta_dot, dt)
        self.other.step(eta, eta_dot, dt)
        self.u_disturbance = self.driving.u_disturbance
        if self.driving.last_step is not None:
            zeta = self.driving.zeta
            costs = [
                one.learner.predicted_cost(zeta, one.learner.actor_1, one.learner.actor_2)
                for one in (self.driving, self.other)
            ]
            self.seen.append((zeta, costs[0], costs[1]))
            self.times.append(self._t)
        self._t += dt
        return tau_b

    def body_wrench(self, u: Array) -> Array:
        return self.driving.body_wrench(u)


def _worker(shipment: tuple[Scenario, Case]) -> Work[Array, Result]:
    scenario, case = shipment
    optimum = QuickValue(scenario.station_keeping().problem, MeshSettings.fine)
    wrong = case.scenario(scenario)

    def work(zeta: Array) -> Iterator[Result]:
        duration = min(WATCHED, wrong.simulation.duration)
        there = {"initial_state": tuple(zeta.tolist()), "duration": duration, "mode": "game"}
        driving, other = (Controller(one.with_settings(simulation=there)) for one in (wrong, scenario))
        start = driving.learner
        before = start.predicted_cost(zeta, start.actor_1, start.actor_2) / optimum(zeta) - 1.0
        both = _Beside(driving, other)
        history = finished(run(wrong.with_settings(simulation=there), both))
        values = np.array([optimum(seen) for seen, _, _ in both.seen])
        yield {
            "zeta": zeta.tolist(),
            "times": both.times,
            "wrong": (np.array([cost for _, cost, _ in both.seen]) / values - 1.0).tolist(),
            "right": (np.array([cost for _, _, cost in both.seen]) / values - 1.0).tolist(),
            "before": before,
            "stopped": history.stopped,
        }

    return work


def regressors(
    problem: Problem, basis: Basis, functions: ValueFunctions, points: Array, actor: Array
) -> Array:
    """Return ω_j / sqrt(p_j) of (18) at the rows of `points` for equal actors, shape (N, m)."""
    terms = BellmanTerms.at(points, functions.at(points), problem.game)
    omega = bellman_error(terms, problem.game, actor, actor, actor).omega
    return np.asarray(omega / (1.0 + np.sum(omega**2, axis=1, keepdims=True)) ** 0.25)


def rank_and_margin(rows: Array) -> tuple[int, float]:
    """Return the numerical rank and λ_min of the sum of (18) from `regressors` (N, m).

    Both from the singular values, those below 1e-10 of the largest counted as zero.
    """
    singular = np.linalg.svd(rows, compute_uv=False)
    rank = int(np.sum(singular > 1e-10 * singular[0])) if singular[0] > 0.0 else 0
    return rank, float(singular[-1] ** 2) if rank == rows.shape[1] else 0.0
