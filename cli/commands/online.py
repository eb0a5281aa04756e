"""`stationkeep online`: run the learner in closed loop and keep the record."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
import xarray as xr

from ...comparison.merit import dissipation_margin, run_metrics
from ...comparison.records import online_record
from ...offline import QuickValue
from ...symbolic import RunError, Setup
from ..output import load_scenario, output_folder, print_json, print_table, progress


def run(options: argparse.Namespace) -> int:
    """Run the scenario's learner, write its record and print what came out."""
    scenario = load_scenario(options)
    station = scenario.setup()
    path = output_folder(options) / "learned.nc"
    duration = scenario.simulation.duration
    with progress(options) as tell:
        record = online_record(scenario, path, progress=lambda t: tell("learned run", t / duration))
    metrics = run_metrics(record, station, None)
    stopped = metrics.stopped
    answer: dict[str, Any] = {
        "weights": {name: _last(record, name) for name in ("critic", "actor_1", "actor_2")},
        "bellman_error": _last(record, "bellman_error"),
        "sample_error": _last(record, "sample_error"),
        **_monitored(record),
        "cost": metrics.cost,
        "final_state": record["zeta"].values[-1],
        "real_time_factor": float(record["time"][-1]) / float(record.attrs["wall_seconds"]),
        "stopped": stopped,
        "unlearned": metrics.unlearned,
        "record": path,
    }
    if scenario.simulation.mode == "disturbed":
        answer["dissipation_margin"] = _margin(record, station)
        answer["notes"] = {
            "cost": "integral of ζ'Qζ + u_1'R u_1, with ζ'P ζ for the rest",
            "dissipation_margin": "with the offline optimum's value at both ends",
        }
    if options.json:
        print_json(answer)
    else:
        _print(answer, scenario.simulation.mode)
    return 0 if stopped is None and metrics.unlearned is None else 1


def _margin(record: xr.Dataset, station: Setup) -> float | None:
    """Return the dissipation margin of what was run, None if nothing was or there is no value."""
    zeta = record["zeta"].values
    if not len(zeta):
        return None
    value = QuickValue(station.problem)
    try:
        return dissipation_margin(record, value(zeta[0]), value(zeta[-1]))
    except RunError:
        return None


def _monitored(record: xr.Dataset) -> dict[str, float | None]:
    """Return the worst that the monitor saw over the run, each None if it saw nothing."""
    least = ("rank_margin", "row_margin", "row_rank")
    largest = ("regressor", "fixed_error_max", "actor_norm", "actor_distance")
    answer: dict[str, float | None] = dict.fromkeys((*least, *largest))
    if record.sizes["look_time"]:
        answer |= {name: float(record[name].min()) for name in least}
        answer |= {name: float(record[name].max()) for name in largest}
    return answer


def _last(record: xr.Dataset, name: str) -> Any:
    values = record[name].values
    return values[-1] if len(values) else None


def _print(answer: dict[str, Any], mode: str) -> None:
    final = np.array2string(np.asarray(answer["final_state"]), precision=4, suppress_small=True)
    rows = [
        ["cost (with ζ'P ζ for the rest)", _form(answer["cost"], ".4f")],
        ["Bellman error at the state [cost/s]", _form(answer["bellman_error"], ".2e")],
        ["error that is learned from, rms, relative", _form(answer["sample_error"], ".3f")],
        ["rank margin of (18) at the fixed samples, least", _form(answer["rank_margin"], ".2e")],
        ["margin of the critic's own rows and leash, least", _form(answer["row_margin"], ".2e")],
        ["directions that these rows decide, fewest", _form(answer["row_rank"], ".0f")],
        ["largest regressor |ω| at the fixed samples [1/s]", _form(answer["regressor"], ".3g")],
        ["largest actor, part of the projection's bound", _form(answer["actor_norm"], ".3f")],
        ["simulated time over wall time", _form(answer["real_time_factor"], ".1f")],
        ["final state", final],
        ["ended early", answer["stopped"] or "no"],
        ["learned", answer["unlearned"] or "yes"],
        ["record", str(answer["record"])],
    ]
    if "dissipation_margin" in answer:
        rows.insert(1, ["dissipation margin", _form(answer["dissipation_margin"], ".4f")])
    print_table(f"Online run, mode '{mode}'", ["", ""], rows)


def _form(value: float | None, form: str) -> str:
    return "–" if value is None else f"{value:{form}}"
