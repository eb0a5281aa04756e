"""What the cost of a run is held against: the game's optimum, or in a real disturbance the clairvoyant.

The scenario's mode chooses one of the two, once; whatever differs between them is said here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import xarray as xr

from ...offline import QuickValue
from ...symbolic import Setup
from ..merit import Regret, RunMetrics, below_optimum, dissipation_margin
from ..policies import label_of
from ..records import KIND as CLAIRVOYANT
from ..scenario import Scenario

OPTIMUM = "optimal"  # kind of the record of the game's optimum
TWO = ("learned", "linear")  # policies that a verdict is on; a run of theirs that ends early is a fault


@dataclass(frozen=True)
class Optimum:
    """What a comparison keeps of the optimum from one state; a `fault` where there is none."""

    value: float | None
    value_error: float
    fault: str = ""


@dataclass(frozen=True)
class Reference(ABC):
    """An optimum that regret refers to.

    Attributes
    ----------
    record : of the one from the scenario's own state; None where it was not found
    optima : from each state
    kind, solved : of its record, and of the optima that a comparison solves from each state
    label, name, symbol : in a table, in a sentence, and of its value
    words : what a report explains, by the word; {subject} is what moves
    note : on regret, for a program that reads it; None where there is nothing to add
    against : what the disturbance does, for a report, with {gamma} and {disturbance}
    """

    record: xr.Dataset | None
    optima: list[Optimum]

    kind: ClassVar[str]
    solved: ClassVar[tuple[str, ...]]
    label: ClassVar[str]
    name: ClassVar[str]
    symbol: ClassVar[str]
    words: ClassVar[Mapping[str, str]]
    note: ClassVar[str | None]
    against: ClassVar[str]

    @property
    def known(self) -> bool:
        """Whether there is one from the scenario's own state, and so a regret."""
        return self.record is not None and bool(self.optima[0].value)

    @staticmethod
    @abstractmethod
    def cost(run: RunMetrics) -> float | None:
        """Return the cost of a run that is held against the optimum's."""

    @abstractmethod
    def too_short(self, run: RunMetrics) -> bool:
        """Return whether the run ended before its regret was decided."""

    @abstractmethod
    def doubts(self, state: int, runs: Mapping[str, RunMetrics]) -> list[str]:
        """Return what speaks against the optimum from a state; `runs` of the policies from there."""

    @abstractmethod
    def margins(self, setup: Setup, records: Mapping[str, xr.Dataset]) -> dict[str, float]:
        """Return the dissipation margin of each run, where one is asked for."""

    @abstractmethod
    def verdict(self, regrets: Mapping[str, Regret] | None, runs: Mapping[str, RunMetrics]) -> str:
        """Return the outcome for the learned and the linear policy in one sentence.

        Parameters
        ----------
        regrets : over all states, None without any
        runs : from the scenario's own state
        """


class GameOptimum(Reference):
    """The optimum of the game: every policy meets the answer of the second player."""

    kind = OPTIMUM
    solved = (OPTIMUM,)
    label, name, symbol = "offline optimum", "optimum", "V*"
    words: ClassVar[Mapping[str, str]] = {}
    note = None
    against = (
        "The disturbance is a second player, who wants the opposite and pays γ² for his effort "
        "(γ = {gamma:g}); every policy meets the answer of this player to its own "
        "control, so that V* is the least possible cost for all of them."
    )

    @staticmethod
    def cost(run: RunMetrics) -> float | None:
        """Return the cost with what is left after the run."""
        return run.cost

    def too_short(self, run: RunMetrics) -> bool:
        """Return whether more than a thousandth of the cost is still to come."""
        return (run.rest_share or 0.0) > 1e-3

    def doubts(self, state: int, runs: Mapping[str, RunMetrics]) -> list[str]:
        """Return the policies that cost less, beyond the errors of the value and of their runs."""
        found = []
        for name, run in runs.items():
            error = self.optima[state].value_error + (run.cost_error or 0.0)
            fault = below_optimum(run.regret, error)
            found += [] if fault is None else [f"{label_of(name)}: {fault}"]
        return found

    def margins(self, setup: Setup, records: Mapping[str, xr.Dataset]) -> dict[str, float]:
        """Return none: the second player keeps to the game."""
        return {}

    def verdict(self, regrets: Mapping[str, Regret] | None, runs: Mapping[str, RunMetrics]) -> str:
        """Return how much more than the optimum the two policies cost, as the median of all states."""
        learned, linear = (np.inf if regrets is None else regrets[name].median for name in TWO)
        if not np.isfinite([learned, linear]).all():
            return "A run ended early, so there is no regret to compare."
        states = "" if len(self.optima) == 1 else f" (median of {len(self.optima)} states)"
        told = (
            f"The learned policy costs {100 * learned:.3f} % more than the optimum{states}; the linear "
            f"H-infinity policy, which learns nothing, {100 * linear:.2f} %"
        )
        better = _better(_everywhere(regrets))
        if runs["learned"].unlearned:
            return f"{told}. Nothing was learned.{better}"
        if linear <= 0.0:  # nothing was left to learn
            return f"{told}.{better}"
        change = 100 * (learned - linear) / linear
        outcome = f"takes {-change:.0f} % off" if change < 0 else f"adds {change:.0f} % to"
        return f"{told}: learning {outcome} the excess.{better}"


class ClairvoyantOptimum(Reference):
    """The least cost over the time of a run for a control that knows the whole disturbance."""

    kind = CLAIRVOYANT
    solved = (OPTIMUM, CLAIRVOYANT)
    label = name = "clairvoyant optimum"
    symbol = "V_c"
    words: ClassVar[Mapping[str, str]] = {
        "clairvoyant optimum": "the least cost over the time of the run for a control that knows the "
        "whole disturbance beforehand, from the same state, for the {subject} that is driven; V_c is "
        "this cost",
        "regret": "cost of a policy over the time of the run minus V_c, divided by V_c; nothing is "
        "added for what is left at the end",
        "dissipation margin": "how far the run stayed within the attenuation that the game promises",
    }
    note = (
        "(cost - V_c) / V_c over the time of the run, nothing added for what is left then; V_c is the "
        "clairvoyant optimum's cost"
    )
    against = (
        "The disturbance is real ({disturbance}), and no policy knows it beforehand. The clairvoyant "
        "optimum does: it is the least that any control could pay over the time of the run that "
        "knows the whole disturbance from the start, and so what no policy can beat. How much more "
        "a policy pays is its regret: the price of not knowing the future, and of its own faults."
    )

    @staticmethod
    def cost(run: RunMetrics) -> float | None:
        """Return the cost over the time of the run."""
        return run.running_cost

    def too_short(self, run: RunMetrics) -> bool:
        """Return False: the regret is that of the time of the run."""
        return False

    def doubts(self, state: int, runs: Mapping[str, RunMetrics]) -> list[str]:
        """Return its own fault, and the policies that cost less."""
        optimum = self.optima[state]
        found = [optimum.fault] if optimum.fault else []
        for name, run in runs.items():
            regret = run.regret
            if regret is not None and regret < -optimum.value_error:
                found.append(f"the run of {label_of(name)} costs {-100 * regret:.2g} % less")
        return [f"{self.name}: {doubt}" for doubt in found]

    def margins(self, setup: Setup, records: Mapping[str, xr.Dataset]) -> dict[str, float]:
        """Return the dissipation margin of the runs that did not end at once."""
        value = QuickValue(setup.problem)
        ends = {name: record["zeta"].values[[0, -1]] for name, record in records.items()}
        return {
            name: dissipation_margin(records[name], value(first), value(last))
            for name, (first, last) in ends.items()
            if len(records[name]["time"]) > 1
        }

    def verdict(self, regrets: Mapping[str, Regret] | None, runs: Mapping[str, RunMetrics]) -> str:
        """Return how much more the two policies cost, or which costs less without this optimum."""
        learned, linear = (runs[name].regret if self.known else runs[name].running_cost for name in TWO)
        sentence = "There is no clairvoyant optimum to compare with, and so no regret"
        if self.known:
            sentence = "The clairvoyant optimum knows the whole disturbance beforehand"
        if learned is None or linear is None:
            ended = "A run of the two policies ended early, so there are no costs to compare."
            return f"{sentence}. {ended}"
        if not self.known:
            share = 100.0 * (learned - linear) / linear
            words = f"{-share:.1f} % less" if share < 0.0 else f"{share:.1f} % more"
            told = f"{sentence}. The learned policy costs {words} than the linear H-infinity policy."
        else:
            told = (
                f"{sentence}: over the same run the learned policy costs {100 * learned:.2f} % more "
                f"than it, the linear H-infinity policy {100 * linear:.2f} %."
            )
        nothing = " Nothing was learned." if runs["learned"].unlearned else ""
        costs = {name: run.regret if self.known else run.running_cost for name, run in runs.items()}
        return f"{told}{nothing}{_better({k: c for k, c in costs.items() if c is not None})}"


BY_MODE: dict[str, type[GameOptimum] | type[ClairvoyantOptimum]] = {
    "game": GameOptimum,
    "disturbed": ClairvoyantOptimum,
}


def _everywhere(regrets: Mapping[str, Regret] | None) -> dict[str, float]:
    """Return the median regret of each policy that was run from as many states as the learned one."""
    known = {} if regrets is None else regrets
    return {name: regret.median for name, regret in known.items() if regret.n == known["learned"].n}


def _better(costs: Mapping[str, float]) -> str:
    """Return the sentence that names the policies that cost less than the learned one, or nothing."""
    names = [label_of(name) for name, cost in costs.items() if cost < costs["learned"]]
    if not names:
        return ""
    listed = f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]
    return f" Better than learned: {listed}."


def reference_of(scenario: Scenario) -> type[GameOptimum] | type[ClairvoyantOptimum]:
    """Return what the runs of a scenario are held against."""
    return BY_MODE[scenario.simulation.mode]
