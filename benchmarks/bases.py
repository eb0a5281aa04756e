"""What each basis can represent, beside what the learner makes of it, printed as one table.

python benchmarks/bases.py [--bases quadratic,drag,FILE.py:FUNCTION] [--scales 0.35] [--states N]

For each basis and scale s of the envelope, over N seeded states s × half-widths × U(-1, 1)^12 ×
U(0.1, 1):

- ε = V - W'σ, ε' = V_ζ - σ''W and the error of the policy v, each relative and as rms / largest, of
  the ideal weights: fitted to (V, V_ζ) at other states (direct solves), measured at the states whose
  certificate holds;
- regret (cost - V*) / V* as median / 90 % / largest of runs from all N states: the ideal weights used
  as they are, the learner while it learns from the Riccati weights (`online`), and what one run from
  another state remembered (`frozen`). A run that ends early counts as infinite.

The linear H-infinity policy, which has no basis, comes first. Another basis of one's own is given as
FILE.py:FUNCTION, like `basis.name` of a scenario.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from regret import SEED
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import Regret, game_cost
from stationkeep.comparison.merit import regret as regret_of
from stationkeep.comparison.optima import fit, ideal_record
from stationkeep.comparison.optima.ideal import Fit
from stationkeep.comparison.policies import LinearPolicy, OnVehicle
from stationkeep.offline import ErrorSize, OfflineSolver, Pairs, QuickValue
from stationkeep.offline.path import MeshSettings
from stationkeep.online import Controller, History, draw_samples, run, save
from stationkeep.symbolic import RunError
from studies.cases import Case, finished
from studies.lesson import lesson

Run = Callable[[Scenario], History]


class Reference:
    """Optima of one envelope, which no basis changes.

    Attributes
    ----------
    states, values : (N, 12) that are scored, (N,) their V*
    training : to fit to
    certified : those of the scored states whose certificate holds
    """

    def __init__(self, scenario: Scenario, n_states: int, n_training: int) -> None:
        station = scenario.station_keeping()
        solver = OfflineSolver(station.problem, scenario.offline)
        self.states = draw_samples(station.envelope, n_states, SEED)
        quick = QuickValue(station.problem, MeshSettings.fine)
        found = [quick.solution(z) for z in self.states]
        self.values = np.array([solution.value for solution in found])
        kept = []
        for i, zeta in enumerate(self.states):
            try:
                solution = solver.solve(zeta)
            except RunError:
                continue
            if not solution.faults:
                kept.append((zeta, solution.value, solution.costate))
                self.values[i] = solution.value
        self.certified = Pairs(*(np.array(column) for column in zip(*kept, strict=True)))
        starts = draw_samples(station.envelope, n_training, SEED + 2)
        solved = [quick.solution(z) for z in starts]
        values, costates = [s.value for s in solved], [s.costate for s in solved]
        self.training = Pairs(starts, np.array(values), np.array(costates))


def regret(scenario: Scenario, reference: Reference, go: Run) -> str:
    """Return median, 90 % and largest regret in per cent."""
    P, found = scenario.station_keeping().problem.P, []
    for zeta, value in zip(reference.states, reference.values, strict=True):
        one = scenario.with_settings(simulation={"initial_state": zeta})
        found.append(regret_of(game_cost(finished(go(one)), P), value))
    one_of = Regret.of(found)
    return "/".join(f"{100.0 * value:6.3f}" for value in (one_of.median, one_of.p90, one_of.max))


def linear_run(scenario: Scenario) -> History:
    """Return the run of the linear H-infinity policy."""
    return run(
        scenario,
        OnVehicle(LinearPolicy(scenario.station_keeping().problem), scenario.station_keeping()),
    )


def as_they_are(scenario: Scenario, found: Fit, reference: Reference, folder: Path) -> Run:
    """Return runs with the ideal weights, frozen and without safeguard."""
    record = ideal_record(scenario, found, reference.training, reference.certified)
    path = save(record, folder / f"ideal-{len(list(folder.iterdir()))}.nc")

    def go(one: Scenario) -> History:
        kept = one.with_settings(learner={"weights": str(path), "safeguard": False})
        return run(kept, Controller(kept, learn=False))

    return go


def frozen(scenario: Scenario, folder: Path) -> Run:
    """Learn once, from a state that is not scored, and return runs with what was remembered."""
    (start,) = draw_samples(scenario.station_keeping().envelope, 1, SEED + 1)
    path = lesson(scenario, Case("lesson"), start, folder).path

    def go(one: Scenario) -> History:
        kept = one.with_settings(learner={"weights": str(path)})
        return run(kept, Controller(kept, learn=False))

    return go


def errors(size: ErrorSize) -> str:
    """Return rms and largest of a relative error in per cent."""
    return f"{100.0 * size.rms_relative:6.2f}/{100.0 * size.sup_relative:6.2f}"


def rows(scale: float, options: argparse.Namespace, folder: Path) -> None:
    """Print the rows of one scale."""
    reference = None
    for name in options.bases.split(","):
        settings = [f"envelope.scale={scale}", f"simulation.duration={options.duration}"]
        settings += ["simulation.mode=game", *options.set, f"basis.name={name}"]
        scenario = Scenario.load(options.scenario, settings)
        station = scenario.station_keeping()
        if reference is None:
            reference = Reference(scenario, options.states, options.training)
            n_certified = len(reference.certified.values)
            print(f"s = {scale:g}: {n_certified} of {options.states} states certified", flush=True)
            linear = regret(scenario, reference, linear_run)
            print(f"{'linear H-infinity':24s}{'':57s}{linear}", flush=True)
        found = fit(station, reference.training, reference.certified)
        shown = [errors(size) for size in (found.epsilon, found.epsilon_prime, found.policy)]
        runs = (as_they_are(scenario, found, reference, folder), run, frozen(scenario, folder))
        shown += [regret(scenario, reference, go) for go in runs]
        label = f"{Path(name).name} ({station.basis.n_basis})"
        print(f"{label:22s}" + "".join(f"  {text}" for text in shown), flush=True)


def main() -> None:
    """Read the options and print the table."""
    parser = argparse.ArgumentParser(description="what a basis can represent, and what is learned")
    parser.add_argument("--scenario", default="bluerov2-heavy")
    parser.add_argument("--bases", default="quadratic,drag,drag-cubic")
    parser.add_argument("--scales", default="0.35,1.0")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--training", type=int, default=400, help="states that are fitted to")
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    titles = ("ε rms/max", "ε'", "policy v", "ideal: median/90%/max", "online", "frozen")
    widths = (13, 13, 13, 20, 20, 20)
    print("all in %; ε, ε', v relative, of the ideal weights; then regret")
    pairs = zip(titles, widths, strict=True)
    print(f"{'basis (functions)':22s}" + "".join(f"  {t:{w}s}" for t, w in pairs))
    with tempfile.TemporaryDirectory() as folder:
        for scale in options.scales.split(","):
            rows(float(scale), options, Path(folder))


if __name__ == "__main__":
    main()
