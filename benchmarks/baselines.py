"""The learned policy beside linear H-infinity, LQR, cascaded PID and model predictive control.

    python benchmarks/baselines.py [--states N] [--duration T] [--json FILE]

First table: undisturbed, from seeded states of the envelope, cost of the single-player equivalent
(how policies without a disturbance player are driven there: `comparison/policies.py`). Second table:
from rest at the station in currents and waves, with thruster limits, measurement noise and another
vehicle as the plant, one by one and together. Runs that end early are counted, not dropped: their
other figures are those up to that moment. The dissipation margin is guaranteed for the optimal u_1
only.
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
from stationkeep.comparison.contenders import CONTENDERS
from stationkeep.comparison.metrics import (
    GameValue,
    RunMetrics,
    dissipation_margin,
    distribution,
    run_metrics,
)
from stationkeep.comparison.mpc import ModelPredictive, PredictionSettings
from stationkeep.comparison.runs import online_record
from stationkeep.online import Policy, draw_samples
from stationkeep.online.record import write_text

Make = Callable[[Scenario], Policy]
HORIZONS = (2.0, 3.0, 4.0)
DIRECTION = np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0)), 0.0])
NOISE = {"position": 0.02, "attitude": 0.01, "velocity": 0.02, "rate": 0.01, "seed": 1}
VARIANTS: dict[str, dict[str, Any]] = {
    "": {},
    "limits": {"thruster_limits": True},
    "noise": {"noise": NOISE},
    "mismatch": {"plant": "bluerov2-heavy-2024"},
    "all three": {"thruster_limits": True, "noise": NOISE, "plant": "bluerov2-heavy-2024"},
}


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


def disturbances() -> dict[str, dict[str, Any]]:
    """Return the disturbances by name."""
    currents = {
        f"current {speed:g} m/s": {"kind": "current", "velocity": tuple((speed * DIRECTION).tolist())}
        for speed in (0.1, 0.25, 0.5)
    }
    sea = {"kind": "waves", "wave_heading": 30.0}
    return {
        **currents,
        "waves Hs 0.25 m": sea | {"wave_height": 0.25, "wave_period": 4.0, "depth": 3.0},
        "waves Hs 0.5 m": sea | {"wave_height": 0.5, "wave_period": 5.0, "depth": 3.0},
    }


def undisturbed(scenario: Scenario, n_states: int) -> list[dict[str, Any]]:
    """Print and return the first table."""
    station = scenario.station_keeping()
    states = draw_samples(station.envelope, n_states, scenario.simulation.seed)
    value = GameValue(station)
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
        regret = distribution([metrics.regret for metrics in found])
        row = {"policy": name, "regret": regret, "failed_solves": lost, "solves": solves}
        row |= {key: median(found, key) for key in FIGURES}
        rows.append(row)
        shares = "".join(f"{100.0 * regret[key]:>{w}.3f}" for key, w in (("p90", 7), ("max", 7)))
        print(
            f"{name:<24}{100.0 * regret['median']:>19.3f}{shares}{regret['diverged']:>8}"
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


def disturbed(scenario: Scenario, duration: float) -> list[dict[str, Any]]:
    """Print and return the second table."""
    print(
        f"\nfrom rest, {duration:g} s disturbed\n{'disturbance':<18}{'with':<11}{'policy':<24}"
        f"{'rms [m]':>8}{'max [m]':>9}{'energy [J]':>12}{'saturated [%]':>15}{'margin':>11}"
        f"{'/supplied [%]':>15}  ended early"
    )
    value, rows = GameValue(scenario.station_keeping()), []
    for name, disturbance in disturbances().items():
        plain = name in ("current 0.1 m/s", "current 0.5 m/s", "waves Hs 0.25 m")
        for variant in ("", "limits") if plain else VARIANTS:
            changes = {
                "mode": "disturbed",
                "initial_state": (0.0,) * 12,
                "duration": duration,
                "disturbance": disturbance,
                **VARIANTS[variant],
            }
            there = scenario.with_settings(simulation=changes)
            for policy, make in policies((3.0,)).items():
                row = {"disturbance": name, "with": variant, "policy": policy}
                rows.append(row | disturbed_run(there, make, policy, value))
                print_disturbed(rows[-1])
    return rows


def disturbed_run(scenario: Scenario, make: Make, kind: str, value: GameValue) -> dict[str, Any]:
    """Return the figures of one run."""
    record = online_record(scenario, policy=lambda: make(scenario), kind=kind)
    metrics, zeta = run_metrics(record, scenario.station_keeping(), None), record["zeta"].values
    margin = dissipation_margin(record, value(zeta[0]), value(zeta[-1]))
    names = ("position_rms", "excursion", "energy", "saturated", "stopped")
    supplied = float(record["attenuated"].values[-1])
    return {name: getattr(metrics, name) for name in names} | {"margin": margin, "supplied": supplied}


def print_disturbed(row: dict[str, Any]) -> None:
    """Print a row of the second table."""
    saturated = "" if row["saturated"] is None else f"{100.0 * row['saturated']:.1f}"
    print(
        f"{row['disturbance']:<18}{row['with']:<11}{row['policy']:<24}{row['position_rms']:>8.3f}"
        f"{row['excursion']:>9.3f}{row['energy']:>12.1f}{saturated:>15}{row['margin']:>11.2f}"
        f"{100.0 * row['margin'] / row['supplied']:>15.1f}  {row['stopped'] or ''}",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--states", type=int, default=20, help="of the first table")
    parser.add_argument("--duration", type=float, default=40.0, help="of the disturbed runs [s]")
    parser.add_argument("--json", type=Path, help="also write the tables there")
    options = parser.parse_args()
    shipped = Scenario.load()
    tables = {
        "undisturbed": undisturbed(shipped, options.states),
        "disturbed": disturbed(shipped, options.duration),
    }
    if options.json:
        write_text(options.json, json.dumps(tables, indent=1))
