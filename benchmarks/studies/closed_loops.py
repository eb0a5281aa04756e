"""Many closed-loop runs in several processes; a row of each is kept as soon as it has ended."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import dissipation_margin, run_metrics
from stationkeep.comparison.parallel import Work
from stationkeep.comparison.records import contender_record, provenance
from stationkeep.offline import QuickValue
from stationkeep.symbolic import RunError

from .kept import Keep, key_of

Row = dict[str, Any]


@dataclass(frozen=True)
class Run:
    """A run to be made.

    Attributes
    ----------
    labels : what tables call it
    policy : a contender's name
    changes : settings of [simulation] that differ from the scenario's
    """

    labels: dict[str, Any]
    policy: str
    changes: dict[str, Any]

    def key(self, common: str) -> str:
        """Return the hash of what the run depends on."""
        plant = str(self.changes.get("plant", ""))
        content = Path(plant).read_text(encoding="utf-8") if plant.endswith(".toml") else plant
        return key_of(json.dumps([common, self.policy, self.changes, content], sort_keys=True))


def run_all(scenario: Scenario, runs: Sequence[Run], file: Path, n_workers: int) -> list[Row]:
    """Return a row for each run, those that `file` has from there, and add the others to it.

    With no worker nothing is run, and the rows are those of the file. A run that was given up has none.
    """
    common = provenance(scenario, "robustness")["key"]
    keys = [one.key(common) for one in runs]
    keep = Keep(file, n_workers, _told)
    if n_workers > 0:
        found = keep.results(_worker, scenario, runs, keys)
        print(file=sys.stderr)
    else:
        known = keep.known()
        found = [known.get(key, {"failure": ""}) for key in keys]
    for one, row in zip(runs, found, strict=True):
        if row.get("failure"):
            print(f"{one.labels} was given up: {row['failure']}", file=sys.stderr)
    return [one.labels | row for one, row in zip(runs, found, strict=True) if "failure" not in row]


def _told(there: int, made: int, total: int) -> None:
    """Show the number of rows that are there."""
    print(f"\r{there} of {total} runs", end="", file=sys.stderr, flush=True)


def _worker(scenario: Scenario) -> Work[Run, Row]:
    value = QuickValue(scenario.station_keeping().problem)

    def work(one: Run) -> Iterator[Row]:
        changed = scenario.with_settings(simulation=one.changes)
        yield row(contender_record(changed, one.policy), changed, value)

    return work


def row(record: xr.Dataset, scenario: Scenario, value: Callable[[np.ndarray], float]) -> Row:
    """Return what is told of a run."""
    station = scenario.station_keeping()
    metrics = asdict(run_metrics(record, station, None))
    zeta = record["zeta"].values
    rest = float(zeta[-1] @ station.problem.P @ zeta[-1])
    found = {name: metrics[name] for name in FIGURES} | {
        "seconds": float(record["time"].values[-1]),
        "spent": float(record["cost"].values[-1]),
        "rest": rest,
        "supplied": float(record["attenuated"].values[-1]),
        "offset": float(np.linalg.norm(zeta[-1, :3])),
        "peak": np.abs(zeta / station.half_widths).max(axis=0).tolist(),
    }
    return found | safeguarded(record) | dissipation(record, value)


FIGURES = ("stopped", "cost", "position_rms", "excursion", "energy", "saturated", "peak_thrust")


def safeguarded(record: xr.Dataset) -> Row:
    """Return how often the safeguard let the actors go all, part or none of the way, and went back."""
    accepted = record["accepted"].values[:-1]  # the last entry is the end of the run
    back = record["fallback"].values[:-1] > 0
    times = record["learn_time"].values[:-1]
    return {
        "learning_steps": len(accepted),
        "whole": int(np.sum(accepted == 1.0)),
        "part": int(np.sum((accepted > 0.0) & (accepted < 1.0))),
        "none": int(np.sum(accepted == 0.0)),
        "back": int(np.sum(back)),
        "first_back": float(times[back][0]) if back.any() else None,
    }


def dissipation(record: xr.Dataset, value: Callable[[np.ndarray], float]) -> Row:
    """Return V at both ends and the margin; None in `game` mode or where V is not found."""
    if record.attrs["mode"] == "game":
        return {"V_start": None, "margin": None}
    zeta = record["zeta"].values
    try:
        start, end = value(zeta[0]), value(zeta[-1])
    except RunError:
        return {"V_start": None, "margin": None}
    return {"V_start": start, "margin": dissipation_margin(record, start, end)}
