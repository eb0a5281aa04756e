"""Policies beside the optimum, from one scenario: runs, figures of merit, regret."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from ...online import draw_samples, load
from ...symbolic import RunError, Setup
from ..merit import Regret, RunMetrics
from ..optima import Ideal
from ..policies import label_of
from ..records import require_runnable
from ..scenario import Scenario
from ..theory import Condition, Theory, run_conditions, scenario_conditions, theory
from .analysis import Field, analysis_record, ideal_of
from .compared_runs import Tell, make_all, policies, record_path
from .excitation import ExcitationRun, excitation_runs
from .reference import OPTIMUM, TWO, Optimum, Reference, reference_of


@dataclass(frozen=True)
class Comparison:
    """What was found when policies were compared.

    Attributes
    ----------
    scenario, setup : what was compared
    records : closed-loop records from the scenario's initial state
    optimal : record of the offline optimum of the game from there
    reference : what regret refers to: the game's optimum, or in a real disturbance the clairvoyant one
    all_metrics : of each policy from each state that it was run from, the scenario's first
    optima : of the game, from each state
    margins : of each record from the scenario's state, in a real disturbance: the dissipation margin
    analysis : errors along and around the learned run, ideal weights; see `analysis_record`
    excitation : runs without and with samples
    conditions : the paper's assumptions and conditions, and what the learned run made of them
    theory : the theorem along the learned run, None without ideal weights
    """

    scenario: Scenario
    setup: Setup
    records: dict[str, xr.Dataset]
    optimal: xr.Dataset
    reference: Reference
    all_metrics: dict[str, list[RunMetrics]]
    optima: list[Optimum]
    margins: dict[str, float]
    analysis: xr.Dataset
    excitation: dict[str, list[ExcitationRun]]
    conditions: list[Condition]
    theory: Theory | None

    @property
    def shown(self) -> xr.Dataset:
        """Record of the optimum that figures show: what regret refers to, else the game's."""
        return self.optimal if self.reference.record is None else self.reference.record

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
        """Of each policy from each state that has an optimum; None where a run ended early."""
        optima = self.reference.optima
        return {
            name: [run.regret for run, optimum in zip(runs, optima, strict=False) if optimum.value]
            for name, runs in self.all_metrics.items()
        }

    @property
    def regret(self) -> dict[str, Regret] | None:
        """The distribution over the states for each policy, a run that ended early as infinite.

        None without the reference from the scenario's own state.
        """
        if not self.reference.known:
            return None
        return {name: Regret.of(regrets) for name, regrets in self.regrets.items()}

    @property
    def verdict(self) -> str:
        """The outcome in one sentence."""
        return self.reference.verdict(self.regret, self.metrics)

    @property
    def too_short(self) -> list[str]:
        """Policies whose run ended before their regret was decided."""
        return [name for name, run in self.metrics.items() if self.reference.too_short(run)]

    @property
    def scaled_rms(self) -> dict[str, float]:
        """Of each record: rms over the run of |x|, the state in half-widths of the envelope."""
        scale = self.setup.half_widths
        sizes = {
            name: np.sum((record["zeta"].values / scale) ** 2, axis=1)
            for name, record in self.records.items()
        }
        return {name: float(np.sqrt(size.mean())) if len(size) else 0.0 for name, size in sizes.items()}

    @property
    def faults(self) -> list[str]:
        """What failed: runs that ended early or learned nothing, and certificates."""
        found = []
        for i, optimum in enumerate(self.optima):
            where = f"state {i + 1}, " if i else ""
            if optimum.fault:
                found.append(f"{where}offline optimum: {optimum.fault}")
            runs = {name: runs[i] for name, runs in self.all_metrics.items() if i < len(runs)}
            found += [f"{where}{doubt}" for doubt in self.reference.doubts(i, runs)]
            for name in TWO:
                stopped = runs[name].stopped
                if stopped:
                    found.append(f"{where}{label_of(name)}: {stopped}")
            if runs["learned"].unlearned:
                found.append(f"{where}{label_of('learned')}: {runs['learned'].unlearned}")
        return found


def scenarios_from(scenario: Scenario, n_states: int) -> list[Scenario]:
    """Return a scenario from its own state, and from n - 1 seeded ones of its envelope."""
    envelope = scenario.setup().envelope
    states = draw_samples(envelope, n_states - 1, scenario.simulation.seed)
    others = [
        scenario.with_settings(simulation={"initial_state": tuple(state.tolist())}) for state in states
    ]
    return [scenario, *others]


def compared(
    scenario: Scenario,
    n_states: int,
    own: Sequence[str],
    field: Field | None,
    folder: Path,
    n_workers: int,
    tell: Tell,
) -> Comparison:
    """Run (or reuse from `folder`) every policy, the user's `own` too, and the optimum of each state.

    Raises
    ------
    InputError
        As `require_runnable`.
    RunError
        If the offline solver does not converge from the scenario's own state, or a worker was lost.
    """
    setup = scenario.setup()
    require_runnable(scenario)
    made = make_all(scenarios_from(scenario, n_states), own, folder, n_workers, tell)
    if made.optima[OPTIMUM][0].value is None:
        raise RunError(made.optima[OPTIMUM][0].fault)
    records = {name: load(record_path(folder, 0, name)) for name in policies(setup, own)}
    tell("errors along the way", 0.0)
    analysis = analysis_record(scenario, records["learned"], field, folder / "analysis.nc")
    ideal = ideal_of(setup, analysis)
    watched = None if ideal is None else theory(scenario, records["learned"], ideal)
    tell("runs without and with samples", 0.0)
    there = [kind for kind, optima in made.optima.items() if optima[0].value is not None]
    best = {kind: load(record_path(folder, 0, kind)) for kind in there}
    kind = reference_of(scenario)
    reference = kind(best.get(kind.kind), made.optima[kind.kind])
    return Comparison(
        scenario=scenario,
        setup=setup,
        records=records,
        optimal=best[OPTIMUM],
        reference=reference,
        all_metrics=made.metrics,
        optima=made.optima[OPTIMUM],
        margins=reference.margins(setup, records),
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
