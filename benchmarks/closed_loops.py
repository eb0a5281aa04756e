"""Many closed-loop runs in several processes; a row of each is kept as soon as it has ended."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.metrics import GameValue, dissipation_margin, run_metrics
from stationkeep.comparison.pool import Work, run_tasks
from stationkeep.comparison.runs import contender_record, provenance
from stationkeep.symbolic import RunError

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
        text = json.dumps([common, self.policy, self.changes, content], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def run_all(scenario: Scenario, runs: Sequence[Run], file: Path, n_workers: int) -> list[Row]:
    """Return a row for each run, those that `file` has from there, and add the others to it.

    The code of the policies is not part of a row's key: remove the file when it has changed. With no
    worker nothing is run, and the rows are those of the file.
    """
    common = provenance(scenario, "robustness")["key"]
    keys = [one.key(common) for one in runs]
    known = _read(file)
    waiting = [(key, one) for key, one in zip(keys, runs, strict=True) if key not in known]
    if n_workers > 0:
        known |= _made(scenario, waiting, file, n_workers)
    return [one.labels | known[key] for key, one in zip(keys, runs, strict=True) if key in known]


def _made(
    scenario: Scenario, waiting: Sequence[tuple[str, Run]], file: Path, n_workers: int
) -> dict[str, Row]:
    """Make runs; return their rows by key, each added to the file when it has ended."""
    made: dict[str, Row] = {}
    file.parent.mkdir(parents=True, exist_ok=True)
    with (
        file.open("a", encoding="utf-8") as out,
        closing(run_tasks(_worker, scenario, [one for _, one in waiting], n_workers)) as events,
    ):
        for event in events:
            key, one = waiting[event.task]
            if event.message is None:
                print(f"\n{one.labels} was given up: {event.failure}", file=sys.stderr)
                continue
            made[key] = event.message
            out.write(json.dumps({"key": key} | event.message) + "\n")
            out.flush()
            print(f"\r{len(made)} of {len(waiting)} runs", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return made


def _read(file: Path) -> dict[str, Row]:
    """Return the rows of a file by key; a line that a killed process left half written is none."""
    if not file.is_file():
        return {}
    text = file.read_text(encoding="utf-8")
    if text and not text.endswith("\n"):
        text = text[: text.rfind("\n") + 1]
        file.write_text(text, encoding="utf-8")
    found = [json.loads(line) for line in text.splitlines()]
    return {row.pop("key"): row for row in found}


def _worker(scenario: Scenario) -> Work[Run, Row]:
    value = GameValue(scenario.station_keeping())

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
