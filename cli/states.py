"""Initial states from the command line, a file or the scenario."""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np

from ..comparison import Scenario
from ..symbolic import InputError, Problem
from ..symbolic.arrays import Array


def initial_states(options: argparse.Namespace, scenario: Scenario) -> list[Array]:
    """Return the initial states of the command line, or the scenario's."""
    problem = scenario.setup().problem
    states = [problem.initial_state(_parse(text, problem)) for text in options.state or []]
    if options.states is not None:
        states += read_states(options.states, problem)
    return states or [scenario.initial_state]


def _parse(text: str, problem: Problem) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"--state {text}: give {problem.n_states} numbers with commas between, "
            f"{','.join(problem.state_names)}"
        ) from None


def read_states(path: Path, problem: Problem) -> list[Array]:
    """Return the rows of a .npy or CSV file, one number for each state; raises InputError."""
    n = problem.n_states
    needed = f"give rows of {n} numbers, as .npy or with commas between"
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
    if table.dtype.kind not in "fiu" or table.ndim != 2 or table.shape[1] != n or not len(table):
        raise InputError(f"'{path}' holds an array of shape {table.shape}; {needed}")
    rows = []
    for i, row in enumerate(table):
        try:
            rows.append(problem.initial_state(row))
        except InputError as error:
            raise InputError(f"'{path}', row {i + 1}: {error}") from None
    return rows


def _read_csv(path: Path) -> Array:
    with path.open(encoding="utf-8", newline="") as file:
        return np.array([[float(cell) for cell in row] for row in csv.reader(file) if row])
