"""Regret of policies over random states of the envelope.

The regret of a policy from a state is (cost - V*) / V* in `game` mode, with ζ'P ζ for what is left at
the end of the run. A run that ends early, or whose V* was not found, is a failure: its regret counts as
infinite, so that it is in every quantile.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from ...offline import DirectSolver
from ...online import Controller, History
from ...symbolic import Problem, RunError
from ...symbolic.arrays import Array
from ..parallel import Work
from ..policies import AnyPolicy, contender
from ..records import closed_loop, provenance
from ..scenario import Scenario
from .kept import Keep, Result, key_of

Task = tuple[int, Array]  # number of the case, and the state


@dataclass(frozen=True)
class Case:
    """A policy whose regret is asked for.

    Attributes
    ----------
    name : for the table
    policy : name of the contender
    changes : settings by group, on top of the contender's; not of vehicle, game or envelope
    learn : False keeps the weights that the policy starts from
    """

    name: str
    policy: str = "learned"
    changes: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    learn: bool = True

    def scenario(self, scenario: Scenario) -> Scenario:
        """Return the scenario that its runs have, in `game` mode."""
        changed = contender(self.policy).changed(scenario).with_settings(**self.changes)
        return changed.with_settings(simulation={"mode": "game"})

    def make(self, scenario: Scenario) -> AnyPolicy:
        """Return the policy of a scenario of its own."""
        return (
            contender(self.policy).make(scenario) if self.learn else Controller(scenario, learn=False)
        )


@dataclass(frozen=True)
class Row:
    """One run.

    Attributes
    ----------
    value : V*(ζ_0); NaN if it was not found
    cost : of the game; infinite if the run ended early
    stopped : why it ended early or has no V*, or None
    simulated, seconds : how long it lasted, in simulated and in wall time [s]
    """

    value: float
    cost: float
    stopped: str | None
    simulated: float
    seconds: float

    @property
    def regret(self) -> float:
        """(cost - V*) / V*, infinite for a failure."""
        regret = (self.cost - self.value) / self.value
        return regret if math.isfinite(regret) else math.inf


@dataclass(frozen=True)
class Summary:
    """Regrets of n runs, `failed` of them infinite; every quantile is the regret of one of them."""

    n: int
    failed: int
    median: float
    p90: float
    largest: float

    @classmethod
    def of(cls, regrets: Iterable[float]) -> Summary:
        """Return the summary of regrets, failures as infinity; infinite if there are none."""
        found = np.array(list(regrets))
        if not len(found):
            return cls(0, 0, math.inf, math.inf, math.inf)
        quantiles = np.quantile(found, [0.5, 0.9, 1.0], method="higher")
        return cls(len(found), int(np.sum(~np.isfinite(found))), *(float(q) for q in quantiles))


@dataclass(frozen=True)
class Target:
    """What median and maximum of the regret may be at most, as parts of the linear policy's."""

    median: float
    largest: float

    def met(self, found: Summary, linear: Summary) -> tuple[bool, bool]:
        """Return whether median and maximum are small enough; to infinite ones nothing is."""
        return (
            found.median <= self.median * linear.median < math.inf,
            found.largest <= self.largest * linear.largest < math.inf,
        )


# by the largest scale of the envelope that they hold to
REQUIRED = {0.6: Target(1 / 3, 1 / 2), 1.0: Target(1 / 2, 2 / 3)}
MOONSHOT = {0.6: Target(1 / 8, 1 / 5), 1.0: Target(1 / 5, 1 / 3)}


def target(by_scale: Mapping[float, Target], scale: float) -> Target:
    """Return the target at a scale of the envelope, beyond all of them the last."""
    return by_scale[min((s for s in by_scale if s >= scale), default=max(by_scale))]


def regrets(
    scenario: Scenario, cases: Sequence[Case], states: Array, keep: Keep
) -> dict[str, list[Row]]:
    """Return the runs of every case from every row of `states` (N, 12), by the case's name.

    Raises
    ------
    InputError
        If the file of kept runs can't be written.
    """
    tasks: list[Task] = [(number, zeta) for zeta in states for number in range(len(cases))]
    of_case = [
        provenance(case.scenario(scenario), f"{case.policy} {case.learn}")["key"] for case in cases
    ]
    keys = [key_of("regret", of_case[number], zeta.tolist()) for number, zeta in tasks]
    results = keep.results(_worker, (scenario, tuple(cases)), tasks, keys)
    rows = [_row(result) for result in results]
    return {case.name: rows[number :: len(cases)] for number, case in enumerate(cases)}


def finished(history: History) -> History:
    """Return a run that came to its own end; raises KeyboardInterrupt again if the user ended it."""
    if history.stopped is not None and history.stopped.startswith("interrupted"):
        raise KeyboardInterrupt
    return history


def game_cost(history: History, P: Array) -> float:
    """Return what a run cost in the game, ζ(T)'P ζ(T) included; infinite if it ended early."""
    if history.stopped:
        return math.inf
    end = history.zeta[-1]
    return float(history.cost[-1] - history.attenuated[-1] + end @ P @ end)


class Optimum:
    """V* by the direct solve, to about 1e-7 of itself (2e-6 at worst in the shipped envelope)."""

    def __init__(self, problem: Problem) -> None:
        self._solver = DirectSolver(problem, horizon=60.0, n_intervals=30)
        self._of = cache(self._solved)

    def __call__(self, zeta: Array) -> float:
        """Return V*(ζ); raises RunError where the solver does not converge."""
        return self._of(tuple(zeta.tolist()))

    def _solved(self, zeta: tuple[float, ...]) -> float:
        return self._solver.solve(np.array(zeta), verify=False).value


def _worker(shipment: tuple[Scenario, tuple[Case, ...]]) -> Work[Task, Result]:
    """Build solver and scenarios once; return what runs one case from one state."""
    scenario, cases = shipment
    problem = scenario.station_keeping().problem
    optimum = Optimum(problem)
    scenarios = [case.scenario(scenario) for case in cases]

    def work(task: Task) -> Iterator[Result]:
        number, zeta = task
        one = scenarios[number].with_settings(simulation={"initial_state": tuple(zeta.tolist())})
        history = finished(closed_loop(one, cases[number].make(one)))
        value, stopped = None, history.stopped
        try:
            value = optimum(zeta)
        except RunError as error:
            stopped = stopped or f"there is no optimum to compare with: {error}"
        yield {
            "case": cases[number].name,
            "scale": scenario.envelope.scale,
            "zeta": zeta.tolist(),
            "value": value,
            "cost": None if history.stopped else game_cost(history, problem.P),
            "stopped": stopped,
            "simulated": history.time[-1] if history.time else 0.0,
            "seconds": history.wall_seconds,
        }

    return work


def _row(result: Result) -> Row:
    if "failure" in result:
        return Row(math.nan, math.inf, result["failure"], 0.0, 0.0)
    value, cost = result["value"], result["cost"]
    return Row(
        value=math.nan if value is None else value,
        cost=math.inf if cost is None else cost,
        stopped=result["stopped"],
        simulated=result["simulated"],
        seconds=result["seconds"],
    )
