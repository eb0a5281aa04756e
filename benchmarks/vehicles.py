"""Published vehicles in the tutorial's scenario: optimum, regret of each policy, predictions, printed.

python benchmarks/vehicles.py [SCENARIO ...] [--states N] [--duration S] [--json FILE]

Without scenarios: the shipped ones and `tests/cases/vehicles/*-scenario.toml`. From the scenario's
state and random ones of its envelope; regret (J - V*) / V* in percent, V* certified. `prediction` is
the largest relative error of a predicted cost (`stationkeep check`), `step` the mean time of a learning
step [ms]. A vehicle that is refused is printed with the reason.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison import Scenario, check
from stationkeep.comparison.merit import run_metrics
from stationkeep.comparison.records import contender_record
from stationkeep.offline import OfflineSolver
from stationkeep.online import draw_samples
from stationkeep.online.records import write_text
from stationkeep.symbolic import StationkeepError
from xarray import Dataset

POLICIES = ("learned", "linear", "lqr", "mpc")
SEED = 0
SHIPPED = ("bluerov2-heavy", "rexrov")
CASES = Path(__file__).parents[1] / "tests" / "cases" / "vehicles"


def learning_step(record: Dataset) -> float:
    """Return the mean time of a learning step [ms]: what the mean of all steps has over the median."""
    attributes = record.attrs
    over = attributes["policy_microseconds_mean"] - attributes["policy_microseconds"]
    return float(over * len(record["time"]) / len(record["learn_time"]) / 1e3)


def predictions(scenario: Scenario) -> float:
    """Return the largest relative error of a predicted cost."""
    (row,) = (one for one in check(scenario) if one.name == "predicted costs are accurate")
    assert row.value is not None
    return float(row.value)


def from_state(scenario: Scenario, solver: OfflineSolver, zeta: np.ndarray) -> dict[str, Any]:
    """Return what the policies cost from a state, and what is wrong with the figures."""
    one = scenario.with_settings(simulation={"initial_state": tuple(zeta.tolist())})
    setup, optimum = scenario.setup(), solver.solve(zeta)
    faults, regrets = list(optimum.faults), dict[str, float | None]()
    step = np.nan
    for policy in POLICIES:
        record = contender_record(one, policy)
        metrics = run_metrics(
            record, setup, optimum.value, lambda left: solver.direct.solve(left, verify=False).value
        )
        regrets[policy] = metrics.regret
        faults += [f"{policy}: {why}" for why in (metrics.stopped, metrics.unlearned) if why]
        if policy == "learned":
            step = learning_step(record)
    return {"optimum": optimum.value, "regret": regrets, "step": step, "faults": faults}


def table(name: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Print the rows of one vehicle, and return them."""
    scenario = Scenario.load(name, [f"simulation.duration={options.duration:g}"])
    solver = OfflineSolver(scenario.setup().problem, scenario.offline)
    drawn = draw_samples(scenario.setup().envelope, options.states - 1, SEED)
    error, rows = predictions(scenario), []
    for zeta in (scenario.initial_state, *drawn):
        row = from_state(scenario, solver, zeta) | {"prediction": error}
        shown = "".join(_percent(row["regret"][policy]) for policy in POLICIES)
        print(
            f"{Path(name).stem:<26}{row['optimum']:>12.6f}{shown}{error:>11.1e}{row['step']:>7.1f}",
            flush=True,
        )
        for fault in row["faults"]:
            print(f"    {fault}", flush=True)
        rows.append(row)
    return rows


def _percent(regret: float | None) -> str:
    return f"{'lost':>10}" if regret is None else f"{100.0 * regret:>10.4f}"


def main() -> int:
    """Print the table; 1 if a figure of it is in doubt."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scenarios", nargs="*")
    parser.add_argument("--states", type=int, default=3)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    names = options.scenarios or [*SHIPPED, *map(str, sorted(CASES.glob("*-scenario.toml")))]
    heads = "".join(f"{policy + ' %':>10}" for policy in POLICIES)
    print(f"{'vehicle':<26}{'V*':>12}{heads}{'prediction':>11}{'step':>7}")
    found: dict[str, Any] = {}
    for name in names:
        try:
            found[name] = table(name, options)
        except StationkeepError as error:
            found[name] = str(error)
            print(f"{Path(name).stem}: {error}", flush=True)
    if options.json:
        write_text(options.json, json.dumps(found, indent=1))
    rows = [row for rows in found.values() if isinstance(rows, list) for row in rows]
    return 1 if any(row["faults"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
