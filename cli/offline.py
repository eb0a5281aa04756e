"""`stationkeep offline`: certified optima from one or many states."""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np

from ..comparison import Scenario
from ..comparison.runs import optimal_record
from ..offline import OfflineSolver
from ..symbolic import InputError, RunError, require_state
from ..symbolic.vehicle import Array
from .gamma import add_curves, print_curves, requested_curves
from .output import load_scenario, output_folder, print_json, print_table, progress, write_json

CERTIFICATE = ("value_error", "defect", "hji_residual", "costate_error", "horizon_error")


def run(options: argparse.Namespace) -> int:
    """Solve from every state, write the records and print values with their certificates."""
    scenario = load_scenario(options)
    states = _states(options, scenario)
    station = scenario.station_keeping()
    solver = OfflineSolver(station.problem, scenario.offline)
    curves = requested_curves(options, station.problem, solver.horizon)
    folder = output_folder(options)
    rows: list[dict[str, Any]] = []
    with progress(options) as tell:
        for i, zeta0 in enumerate(states):
            tell("offline optima", i / len(states))
            rows.append(_solve(scenario, solver, folder, zeta0, i))
        add_curves(curves, rows, folder, tell)
    linear = {"P": station.problem.P, "gamma_star": station.problem.gamma_star}
    answer = {"states": rows, "linear": linear}
    write_json(folder / "offline.json", answer)
    if options.json:
        print_json(answer)
    else:
        _print(rows, station.problem.gamma_star, folder)
        print_curves(rows)
    return 1 if any(row["faults"] for row in rows) else 0


def _solve(
    scenario: Scenario, solver: OfflineSolver, folder: Path, zeta0: Array, index: int
) -> dict[str, Any]:
    station = scenario.station_keeping()
    try:
        record = optimal_record(scenario, solver, folder / f"optimal-{index + 1}.nc", zeta0)
    except RunError as error:
        return {
            "zeta": zeta0,
            "value": None,
            "costate": None,
            "u_control": None,
            "u_disturbance": None,
            "certificate": dict.fromkeys(CERTIFICATE),
            "iterations": None,
            "seconds": None,
            "faults": [str(error)],
        }
    costate = record["costate"].values
    g = solver.direct.plant.terms(zeta0)[1]
    u_control, u_disturbance = station.game.policies(g, costate)
    faults = str(record.attrs["faults"])
    return {
        "zeta": zeta0,
        "value": float(record.attrs["value"]),
        "costate": costate,
        "u_control": u_control,
        "u_disturbance": u_disturbance,
        "certificate": {name: float(record.attrs[name]) for name in CERTIFICATE},
        "iterations": int(record.attrs["iterations"]),
        "seconds": float(record.attrs["seconds"]),
        "certified_seconds": float(record.attrs["certified_seconds"]),
        "faults": faults.split("; ") if faults else [],
    }


def _states(options: argparse.Namespace, scenario: Scenario) -> list[Array]:
    """Return the initial states of the command line, or the scenario's."""
    states = [require_state(_parse(text)) for text in options.state or []]
    if options.states is not None:
        states += _read(options.states)
    return states or [scenario.initial_state]


def _parse(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"--state {text}: give 12 numbers with commas between, "
            "x,y,z,phi,theta,psi and their rates [m, rad, m/s, rad/s]"
        ) from None


def _read(path: Path) -> list[Array]:
    """Read rows of 12 numbers from a .npy or CSV file."""
    needed = "give rows of 12 numbers, as .npy or with commas between"
    try:
        table = np.load(path, allow_pickle=False) if path.suffix == ".npy" else _read_csv(path)
    except FileNotFoundError:
        raise InputError(f"there is no file '{path}'; {needed}") from None
    except IsADirectoryError:
        raise InputError(f"'{path}' is a folder; {needed}") from None
    except (OSError, ValueError, EOFError):
        raise InputError(f"'{path}' can't be read as states; {needed}") from None
    if table.ndim == 1:
        table = table[None, :]
    if table.dtype.kind not in "fiu" or table.ndim != 2 or table.shape[1] != 12 or not len(table):
        raise InputError(f"'{path}' holds an array of shape {table.shape}; {needed}")
    rows = []
    for i, row in enumerate(table):
        try:
            rows.append(require_state(row))
        except InputError as error:
            raise InputError(f"'{path}', row {i + 1}: {error}") from None
    return rows


def _read_csv(path: Path) -> Array:
    with path.open(encoding="utf-8", newline="") as file:
        return np.array([[float(cell) for cell in row] for row in csv.reader(file) if row])


def _print(rows: list[dict[str, Any]], gamma_star: float, folder: Path) -> None:
    print_table(
        "Offline optima",
        ["state", "value", *CERTIFICATE, "iterations", "solve [s]", "certified"],
        [
            [
                np.array2string(row["zeta"], precision=3, suppress_small=True, max_line_width=200),
                "–" if row["value"] is None else f"{row['value']:.8g}",
                *("–" if v is None else f"{v:.1e}" for v in row["certificate"].values()),
                "–" if row["iterations"] is None else str(row["iterations"]),
                "–" if row["seconds"] is None else f"{row['seconds']:.2f}",
                "; ".join(row["faults"]) or "yes",
            ]
            for row in rows
        ],
    )
    print(f"gamma* of the linearised game: {gamma_star:.6g}; records: {folder}")
