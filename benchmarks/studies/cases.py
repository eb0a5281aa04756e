"""Regret of policies over random states of the envelope.

The regret of a policy from a state is (cost - V*) / V* in `game` mode, with ζ'P ζ for what is left at
the end of the run. A run that ends early, or whose V* was not found, is a failure, and its
regret infinite.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from stationkeep.comparison.merit import finite, game_cost, regret
from stationkeep.comparison.parallel import Work
from stationkeep.comparison.policies import AnyPolicy, contender
from stationkeep.comparison.records import closed_loop, provenance
from stationkeep.comparison.scenario import Scenario
from stationkeep.offline import QuickValue
from stationkeep.offline.path import MeshSettings
from stationkeep.online import Controller, History
from stationkeep.symbolic import RunError
from stationkeep.symbolic.arrays import Array

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
        found = regret(self.cost, self.value)
        return found if found is not None and math.isfinite(found) else math.inf


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


def _worker(shipment: tuple[Scenario, tuple[Case, ...]]) -> Work[Task, Result]:
    """Build solver and scenarios once; return what runs one case from one state."""
    scenario, cases = shipment
    station = scenario.station_keeping()
    optimum = QuickValue(station.problem, MeshSettings.fine)
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
            "cost": finite(game_cost(history, station.problem.P)),
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
