"""The learned policy beside linear H-infinity, LQR, cascaded PID and model predictive control.

    python benchmarks/baselines.py [--states N] [--json FILE]

Undisturbed, from seeded states of the envelope, cost of the single-player equivalent (how policies
without a disturbance player are driven there: `comparison/policies.py`). Runs that end early are
counted, not dropped: their other figures are those up to that moment. In currents and waves, with
thruster limits, noise and another plant: `robustness.py`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import Regret, RunMetrics, run_metrics
from stationkeep.comparison.policies import CONTENDERS
from stationkeep.comparison.policies.mpc import ModelPredictive, PredictionSettings
from stationkeep.comparison.records import online_record
from stationkeep.offline import QuickValue
from stationkeep.online import Policy, draw_samples
from stationkeep.online.records import write_text

Make = Callable[[Scenario], Policy]
HORIZONS = (2.0, 3.0, 4.0)


def policies(horizons: tuple[float, ...]) -> dict[str, Make]:
    """Return what makes each policy."""
    names = ("learned", "linear", "lqr", "pid")
    makers: dict[str, Make] = {CONTENDERS[name].label: CONTENDERS[name].make for name in names}
    for horizon in horizons:
        makers[f"MPC {horizon:g} s"] = partial(predictive, horizon=horizon)
    return makers


def predictive(scenario: Scenario, horizon: float) -> ModelPredictive:
    """Return the predictive policy of a horizon."""
    return ModelPredictive(scenario.station_keeping(), PredictionSettings(horizon=horizon))


def undisturbed(scenario: Scenario, n_states: int) -> list[dict[str, Any]]:
    """Print and return the table."""
    station = scenario.station_keeping()
    states = draw_samples(station.envelope, n_states, scenario.simulation.seed)
    value = QuickValue(station.problem)
    optima = [value(state) for state in states]
    header = (
        f"{'policy':<24}{'regret [%]: median':>19}{'90 %':>7}{'max':>7}{'failed':>8}{'rms [m]':>9}"
        f"{'max [m]':>9}{'effort':>9}{'energy [J]':>12}{'us/step: median':>17}{'mean':>7}"
        f"{'lost solves':>13}"
    )
    print(f"undisturbed, {n_states} states of scale {scenario.envelope.scale:g}\n{header}")
    rows = []
    for name, make in policies(HORIZONS).items():
        found: list[RunMetrics] = []
        lost = solves = 0
        for state, optimum in zip(states, optima, strict=True):
            there = scenario.with_settings(simulation={"initial_state": tuple(state.tolist())})
            policy = make(there)
            record = online_record(there, policy=lambda p=policy: p, kind=name)  # type: ignore[misc]
            found.append(run_metrics(record, station, optimum))
            lost += getattr(policy, "failures", 0)
            solves += getattr(policy, "solves", 0)
        regret = Regret.of(metrics.regret for metrics in found)
        row = {"policy": name, "regret": regret.as_json(), "failed_solves": lost, "solves": solves}
        row |= {key: median(found, key) for key in FIGURES}
        rows.append(row)
        print(
            f"{name:<24}{100.0 * regret.median:>19.3f}{100.0 * regret.p90:>7.3f}"
            f"{100.0 * regret.max:>7.3f}{regret.diverged:>8}"
            f"{row['position_rms']:>9.3f}{row['excursion']:>9.3f}{row['effort']:>9.1f}"
            f"{row['energy']:>12.1f}{row['policy_microseconds']:>17.0f}{row['policy_mean']:>7.0f}"
            f"{f'{lost}/{solves}' if solves else '':>13}",
            flush=True,
        )
    return rows


FIGURES = (
    *("position_rms", "excursion", "effort", "energy"),
    *("policy_microseconds", "policy_mean"),
)


def median(found: list[RunMetrics], name: str) -> float:
    """Return the median of a figure over the runs."""
    return float(np.median([getattr(metrics, name) for metrics in found]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--json", type=Path, help="also write the table there")
    options = parser.parse_args()
    rows = undisturbed(Scenario.load(), options.states)
    if options.json:
        write_text(options.json, json.dumps({"undisturbed": rows}, indent=1))
