"""Regret of the learned policies beside the linear H-infinity policy, over random states, printed.

python benchmarks/regret.py [--states N] [--scales 0.1,0.35] [--duration S] [--cache FILE]

Regret is (cost - V*) / V* in `game` mode, with ζ'P ζ for what is left at the end of a run and V* from
the direct solve. States are s × half-widths × U(-1, 1)^12 × U(0.1, 1). A run that ends early counts as
infinite regret. `online` starts each run from the Riccati weights and is scored while it learns;
`frozen` uses, without learning, what one run from another state remembered.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.contenders import CONTENDERS
from stationkeep.comparison.policies import LinearPolicy
from stationkeep.offline import DirectSolver
from stationkeep.online import Controller, History, draw_samples, run, save, to_dataset

SEED = 20
Run = Callable[[Scenario], History]


class Values:
    """V* of states, kept in a file if there is one."""

    def __init__(self, scenario: Scenario, file: Path | None) -> None:
        station = scenario.station_keeping()
        self._solver = DirectSolver(station.problem, horizon=60.0, n_intervals=30)
        self._prefix = station.fingerprint
        self._file = file
        known = file is not None and file.is_file()
        self._known: dict[str, float] = json.loads(file.read_text()) if known and file else {}

    def at(self, zeta: np.ndarray) -> float:
        """Return V*(ζ)."""
        key = f"{self._prefix[:16]} {' '.join(f'{entry:.12g}' for entry in zeta)}"
        if key not in self._known:
            self._known[key] = self._solver.solve(zeta, verify=False).value
            if self._file is not None:
                self._file.write_text(json.dumps(self._known))
        return self._known[key]


def cost(history: History, scenario: Scenario) -> float:
    """Return the cost of a run in the game, infinite when it ended early."""
    if history.stopped:
        return np.inf
    end = history.zeta[-1]
    P = scenario.station_keeping().problem.P
    return float(history.cost[-1] - history.attenuated[-1] + end @ P @ end)


def frozen(scenario: Scenario, folder: Path) -> Run:
    """Learn once, from a state that is not scored, and return runs with what was remembered."""
    station = scenario.station_keeping()
    (start,) = draw_samples(station.envelope, 1, SEED + 1)
    remembering = {"remember": True}
    record = run(scenario.with_settings(simulation={"initial_state": start}, samples=remembering))
    path = save(to_dataset(record, {}), folder / f"learned-{scenario.envelope.scale:g}.nc")

    def again(one: Scenario) -> History:
        kept = one.with_settings(learner={"weights": str(path)})
        return run(kept, Controller(kept, learn=False))

    return again


def table(scale: float, options: argparse.Namespace, folder: Path) -> None:
    """Print one row a policy, at one scale of the envelope."""
    scenario = Scenario.load(options.scenario, [f"envelope.scale={scale}", *options.set])
    scenario = scenario.with_settings(simulation={"duration": options.duration, "mode": "game"})
    station = scenario.station_keeping()
    values = Values(scenario, options.cache)
    states = draw_samples(station.envelope, options.states, SEED)
    runs: dict[str, Run] = {
        "linear": lambda one: run(one, LinearPolicy(station)),
        "online": run,
        "frozen": frozen(scenario, folder),
    }
    if not options.no_gradient:
        runs["gradient as printed"] = lambda one: run(CONTENDERS["gradient"].changed(one))
    linear = np.full(3, np.nan)
    for name, go in runs.items():
        regret = np.empty(len(states))
        speed = []
        for i, state in enumerate(states):
            one = scenario.with_settings(simulation={"initial_state": state})
            history = go(one)
            regret[i] = cost(history, one) / values.at(state) - 1.0
            speed.append(history.time[-1] / history.wall_seconds)
        found = 100.0 * np.quantile(regret, [0.5, 0.9, 1.0], method="higher")
        linear = found if name == "linear" else linear
        figures = " / ".join(f"{value:6.3f}" for value in found)
        shares = " / ".join(f"{value:5.3f}" for value in found / linear)
        failed = int(np.sum(~np.isfinite(regret)))
        print(
            f"{scale:5.2f} {name:20s} {figures} %   of linear {shares}   failed {failed}/{len(states)}"
            f"   {np.median(speed):4.0f} x real time",
            flush=True,
        )


def main() -> None:
    """Read the options and print the tables."""
    parser = argparse.ArgumentParser(description="regret of learned and linear policies")
    parser.add_argument("--scenario", default="bluerov2-heavy")
    parser.add_argument("--states", type=int, default=100)
    parser.add_argument("--scales", default="0.1,0.35,0.6,1.0")
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--cache", type=Path, help="JSON file that keeps V*")
    parser.add_argument("--no-gradient", action="store_true", help="leave the gradient law out")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    print("scale policy               median / 90 % / max regret")
    with tempfile.TemporaryDirectory() as folder:
        for scale in options.scales.split(","):
            table(float(scale), options, Path(folder))


if __name__ == "__main__":
    main()
