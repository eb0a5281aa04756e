"""Policies beside the optimum, from one scenario: runs, figures of merit, regret."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from ...online import draw_samples, load
from ...symbolic import RunError, StationKeeping
from ..merit import GameValue, Regret, RunMetrics, dissipation_margin
from ..optima import Ideal
from ..policies import CONTENDERS
from ..records import KIND as CLAIRVOYANT
from ..scenario import Scenario
from ..theory import Condition, Theory, run_conditions, scenario_conditions, theory
from .analysis import Field, analysis_record, ideal_of
from .compared_runs import OPTIMUM, POLICIES, Optimum, Tell, make_all, record_path
from .excitation import ExcitationRun, excitation_runs

JUDGED = ("learned", "linear")  # a run of theirs that ends early is a fault
X_Y = Field(0, 1)


@dataclass(frozen=True)
class Plan:
    """What is to be compared.

    Attributes
    ----------
    scenario : of all runs
    n_states : the scenario's initial state, and seeded ones of its envelope
    field : states over which the Bellman error is drawn
    """

    scenario: Scenario
    n_states: int = 1
    field: Field = X_Y

    def scenarios(self) -> list[Scenario]:
        """Return the scenario from each of the states."""
        envelope = self.scenario.station_keeping().envelope
        states = draw_samples(envelope, self.n_states - 1, self.scenario.simulation.seed)
        others = [
            self.scenario.with_settings(simulation={"initial_state": tuple(state.tolist())})
            for state in states
        ]
        return [self.scenario, *others]


@dataclass(frozen=True)
class Comparison:
    """What `compare` found.

    Attributes
    ----------
    scenario, station : what was compared
    records : closed-loop records from the scenario's initial state
    optimal : record of the offline optimum of the game from there
    clairvoyant : record of the clairvoyant optimum from there in `disturbed` mode; None without one
    all_metrics : of each policy from each state that it was run from, the scenario's first
    optima : of the game, from each state
    clairvoyant_optima : likewise, in `disturbed` mode; else none
    margins : of each record from the scenario's state, in `disturbed` mode: the dissipation margin
    analysis : errors along and around the learned run, ideal weights; see `analysis_record`
    excitation : runs without and with samples
    conditions : the paper's assumptions and conditions, and what the learned run made of them
    theory : the theorem along the learned run, None without ideal weights
    """

    scenario: Scenario
    station: StationKeeping
    records: dict[str, xr.Dataset]
    optimal: xr.Dataset
    clairvoyant: xr.Dataset | None
    all_metrics: dict[str, list[RunMetrics]]
    optima: list[Optimum]
    clairvoyant_optima: list[Optimum]
    margins: dict[str, float]
    analysis: xr.Dataset
    excitation: dict[str, list[ExcitationRun]]
    conditions: list[Condition]
    theory: Theory | None

    @property
    def disturbed(self) -> bool:
        """Whether a real disturbance takes the place of the game's second player."""
        return self.scenario.simulation.mode == "disturbed"

    @property
    def reference(self) -> xr.Dataset:
        """Record of the optimum that figures show: what regret refers to, else the game's."""
        return self.optimal if self.clairvoyant is None else self.clairvoyant

    @property
    def metrics(self) -> dict[str, RunMetrics]:
        """Of each policy from the scenario's own state."""
        return {name: runs[0] for name, runs in self.all_metrics.items()}

    @property
    def n_states(self) -> int:
        """Number of initial states."""
        return len(self.optima)

    @property
    def value_error(self) -> float:
        """Largest relative value error of the optima."""
        return max(optimum.value_error for optimum in self.optima)

    @property
    def regrets(self) -> dict[str, list[float | None]]:
        """Of each policy from each state that has an optimum; None where a run ended early.

        Against the game's optimum, in `disturbed` mode against the clairvoyant one.
        """
        references = self.clairvoyant_optima if self.disturbed else self.optima
        return {
            name: [run.regret for run, optimum in zip(runs, references, strict=False) if optimum.value]
            for name, runs in self.all_metrics.items()
        }

    @property
    def regret(self) -> dict[str, Regret] | None:
        """The distribution over the states for each policy, a run that ended early as infinite.

        None in `disturbed` mode without a clairvoyant optimum: the game's is no reference there.
        """
        if self.disturbed and (self.clairvoyant is None or not self.clairvoyant_optima[0].value):
            return None
        return {name: Regret.of(regrets) for name, regrets in self.regrets.items()}

    @property
    def too_short(self) -> list[str]:
        """Policies whose regret has more than a thousandth of the cost still to come.

        None in `disturbed` mode, where regret is that of the time of the run.
        """
        if self.disturbed:
            return []
        return [name for name, metrics in self.metrics.items() if (metrics.rest_share or 0.0) > 1e-3]

    @property
    def faults(self) -> list[str]:
        """What did not converge: runs that ended early and certificates that failed."""
        found = []
        for number, optimum in enumerate(self.optima, 1):
            where = "" if number == 1 else f"state {number}, "
            if optimum.fault:
                found.append(f"{where}offline optimum: {optimum.fault}")
            if self.disturbed:
                found += [f"{where}clairvoyant optimum: {fault}" for fault in self._doubts(number - 1)]
            for name in JUDGED:
                stopped = self.all_metrics[name][number - 1].stopped
                if stopped:
                    found.append(f"{where}{CONTENDERS[name].label}: {stopped}")
        return found

    def _doubts(self, state: int) -> list[str]:
        """Return why the clairvoyant optimum from a state can't be relied on."""
        optimum = self.clairvoyant_optima[state]
        doubts = [optimum.fault] if optimum.fault else []
        for name, runs in self.all_metrics.items():
            regret = runs[state].regret if state < len(runs) else None
            if regret is not None and regret < -optimum.value_error:
                doubts.append(f"the run of {CONTENDERS[name].label} costs {-100 * regret:.2g} % less")
        return doubts


def compare(plan: Plan, folder: Path, *, n_workers: int = 1, tell: Tell | None = None) -> Comparison:
    """Run (or reuse from `folder`) every policy and the optimum from the same states.

    Parameters
    ----------
    folder : where records are kept; those that still fit the scenario are reused
    n_workers : processes that run at the same time
    tell : called with the name of the present stage and the part of it that is done

    Raises
    ------
    RunError
        If the offline solver does not converge from the scenario's own state, or a worker was lost.
    """
    told = tell if tell is not None else _silent
    scenario, station = plan.scenario, plan.scenario.station_keeping()
    scenarios = plan.scenarios()
    made = make_all(scenarios, folder, n_workers, told)
    if made.optima[0].value is None:
        raise RunError(made.optima[0].fault)
    records = {name: load(record_path(folder, 0, name)) for name in POLICIES}
    seen = bool(made.clairvoyant) and made.clairvoyant[0].value is not None
    told("errors along the way", 0.0)
    analysis = analysis_record(scenario, records["learned"], plan.field, folder / "analysis.nc")
    ideal = ideal_of(station, analysis)
    watched = None if ideal is None else theory(scenario, records["learned"], ideal)
    told("runs without and with samples", 0.0)
    return Comparison(
        scenario=scenario,
        station=station,
        records=records,
        optimal=load(record_path(folder, 0, OPTIMUM)),
        clairvoyant=load(record_path(folder, 0, CLAIRVOYANT)) if seen else None,
        all_metrics=made.metrics,
        optima=made.optima,
        clairvoyant_optima=made.clairvoyant,
        margins=_margins(station, records) if scenario.simulation.mode == "disturbed" else {},
        analysis=analysis,
        excitation=excitation_runs(scenario),
        conditions=_conditions(scenario, records["learned"], ideal, watched),
        theory=watched,
    )


def _conditions(
    scenario: Scenario, learned: xr.Dataset, ideal: Ideal | None, watched: Theory | None
) -> list[Condition]:
    bounds = None if ideal is None else ideal.bounds
    listed = scenario_conditions(scenario, bounds, float(learned["rank_margin"].min()))
    return listed + run_conditions(scenario, learned, watched)


def _margins(station: StationKeeping, records: dict[str, xr.Dataset]) -> dict[str, float]:
    """Return the dissipation margin of the runs that did not end at once."""
    value = GameValue(station)
    ends = {name: record["zeta"].values[[0, -1]] for name, record in records.items()}
    return {
        name: dissipation_margin(records[name], value(first), value(last))
        for name, (first, last) in ends.items()
        if len(records[name]["time"]) > 1
    }


def _silent(name: str, part: float) -> None:
    """Tell nobody."""
