"""`stationkeep offline`: certified optima from one or many states."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...comparison.optima import CERTIFICATE, Optima
from ...comparison.parallel import locked
from ...offline import horizon_of
from ...online.records import remove_temporaries, written_whole
from ...symbolic import Problem
from ..gamma import Curves
from ..ideal_weights import ideal_weights, numbers, show
from ..output import load_scenario, output_folder, print_file, print_table, write_json_rows
from ..saddle import Saddle
from ..solving import n_workers, solve
from ..states import initial_states

SHOWN = 10  # states in the printed table
SHOWN_ERRORS = (
    "value_error",
    "disagreement",
    "defect",
    "hji_residual",
    "costate_error",
)


def run(options: argparse.Namespace) -> int:
    """Solve from every state, write records and tables and print values with their certificates."""
    n_workers(options)  # refuses what is no number of workers before anything is done
    scenario = load_scenario(options)
    states = np.array(initial_states(options, scenario))
    asked = numbers(options, scenario)
    problem = scenario.setup().problem
    limits = scenario.offline.limits
    curves = Curves(options, problem, horizon_of(problem, scenario.offline), limits)
    saddle = Saddle(options, problem, limits)
    folder = output_folder(options)
    with locked(folder):
        remove_temporaries(folder, "offline.*")
        optima = Optima(scenario, states, folder)
        given_up = solve(options, optima, "offline optima")
        rest: dict[str, Any] = {"linear": {"P": problem.P, "gamma_star": problem.gamma_star}}
        if asked is not None:
            rest["ideal_weights"] = ideal_weights(options, scenario, folder, asked)
        told = Told()
        rows = curves.each(optima.rows(given_up), len(states))
        rows = saddle.each(rows, folder, len(states))
        rows = told.each(_into_csv(folder / "offline.csv", problem, rows))
        write_json_rows(folder / "offline.json", "states", rows, rest)
        curves.draw(folder)
    if options.json:
        print_file(folder / "offline.json")
    else:
        told.show()
        curves.show()
        saddle.show()
        print(f"gamma* of the linearised game: {problem.gamma_star:.6g}; records: {folder}")
        if asked is not None:
            show(rest["ideal_weights"])
    return 1 if told.faulty or rest.get("ideal_weights", {}).get("faults") else 0


class Told:
    """What is printed of many rows: the first ones, those with faults, and how many of each.

    Attributes
    ----------
    n, faulty : numbers of states, and of those with faults
    """

    def __init__(self) -> None:
        self.n = 0
        self.faulty = 0
        self.rows: list[tuple[int, dict[str, Any]]] = []

    def each(self, rows: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
        """Yield the rows, and remember what will be shown of them."""
        faults: list[tuple[int, dict[str, Any]]] = []
        for row in rows:
            self.n += 1
            self.faulty += bool(row["faults"])
            if len(self.rows) < SHOWN:
                self.rows.append((self.n, row))
            elif row["faults"] and len(faults) < SHOWN:
                faults.append((self.n, row))
            yield row
        self.rows += faults

    def show(self) -> None:
        """Print the table."""
        print_table(
            "Offline optima",
            [
                "",
                "state",
                "value",
                *(name.replace("_", " ") for name in SHOWN_ERRORS),
                "solve [s]",
                "certified",
            ],
            [[str(number), *_cells(row)] for number, row in self.rows],
        )
        if self.n > len(self.rows):
            print(f"{self.n - len(self.rows)} more states are in offline.csv")
        if self.n > 1:
            print(f"{self.n - self.faulty} of {self.n} states are certified")


def _cells(row: dict[str, Any]) -> list[str]:
    return [
        " ".join(f"{entry:.3g}" for entry in row["zeta"]),
        "–" if row["value"] is None else f"{row['value']:.8g}",
        *(_error(row["certificate"][name]) for name in SHOWN_ERRORS),
        "–" if row["seconds"] is None else f"{row['seconds']:.2f}",
        "; ".join(row["faults"]) or _verdict(row),
    ]


def _error(value: float | None) -> str:
    return "–" if value is None else f"{value:.1e}"


def _verdict(row: dict[str, Any]) -> str:
    """Return that the state is certified, how many other extremals there are, and by which turn."""
    turns = "".join(f", {name} {n:+d} turn" for name, n in row["turns"].items())
    if not row["certificate"]["gradient_unique"]:
        return f"yes{turns}; its gradient is not unique"
    others = len(row["extremals"])
    return f"yes{turns}; the lowest of {others + 1} extremals" if others else f"yes{turns}"


def _into_csv(path: Path, problem: Problem, rows: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the rows and write each to a table, its numbers exact; an unknown number is left empty."""
    states, inputs = problem.state_names, problem.input_names
    vectors: dict[str, tuple[str, ...]] = {"zeta": states, "costate": states}
    vectors |= {"u_control": inputs, "u_disturbance": inputs}
    numbers = ("value", *CERTIFICATE, "iterations", "seconds", "certified_seconds")
    heads = [f"{name}_{part}" for name, parts in vectors.items() for part in parts]
    with written_whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow([*heads, *numbers, "faults"])
        for row in rows:
            flat = row | row["certificate"]
            cells: list[Any] = []
            for name, parts in vectors.items():
                cells += [""] * len(parts) if row[name] is None else row[name].tolist()
            cells += ["" if flat[name] is None else flat[name] for name in numbers]
            table.writerow([*cells, "; ".join(row["faults"])])
            yield row
