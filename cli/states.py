"""Initial states from the command line, a file or the scenario."""

from __future__ import annotations

import argparse
import io
import re
from pathlib import Path

import numpy as np

from ..comparison import Scenario
from ..symbolic import InputError, Problem
from ..symbolic.arrays import Array
from ..symbolic.toml import LARGEST, read_text

_SEPARATORS = {";": r"\s*;\s*", "\t": r"\s*\t\s*", ",": r"\s*,\s*", " ": r"\s+"}


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
    """Return the rows of a .npy or text file, one number for each state.

    A text file has commas, semicolons, tabs or blanks between its numbers, with semicolons and tabs
    decimal commas too; a first line of the states' names, empty lines, comments behind # and separators
    at the ends of lines are passed over.

    Raises
    ------
    InputError
        If there is no such file, or something in it is no state; row and cell are named.
    """
    n = problem.n_states
    needed = f"give rows of {n} numbers, as .npy or with commas between"
    table = _read_array(path, needed) if path.suffix == ".npy" else _read_table(path, problem, needed)
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


def _read_array(path: Path, needed: str) -> Array:
    if not path.is_file():
        raise InputError(f"there is no file '{path}'; {needed}")
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"'{path}' is larger than {LARGEST >> 20} MiB; {needed}")
        with io.BytesIO(path.read_bytes()) as content:
            return np.asarray(np.load(content, allow_pickle=False))
    except InputError:
        raise
    except Exception:  # numpy's readers raise those of the tokenizer, of zip files and more
        raise InputError(f"'{path}' can't be read as states; {needed}") from None


def _read_table(path: Path, problem: Problem, needed: str) -> Array:
    if path.is_dir():
        raise InputError(f"'{path}' is a folder; {needed}")
    rows: list[list[float]] = []
    first = True
    for number, line in enumerate(read_text(path, "a file of states").splitlines(), 1):
        text = line.partition("#")[0].strip().rstrip(",;\t ")
        if not text:
            continue
        cells = _cells(text)
        if first and [cell.strip("\"'") for cell in cells] == list(problem.state_names):
            first = False
            continue
        first = False
        if len(cells) != problem.n_states:
            raise InputError(f"'{path}', line {number} has {len(cells)} cells; {needed}")
        where = f"'{path}', line {number}, cell"
        rows.append([_number(cell, f"{where} {i}") for i, cell in enumerate(cells, 1)])
    if not rows:
        raise InputError(f"'{path}' holds no numbers; {needed}")
    return np.array(rows)


def _cells(text: str) -> list[str]:
    """Return the cells of a line; a comma that is not the separator is a decimal point."""
    separator = next(one for one in (*_SEPARATORS, text) if one in text)
    cells = re.split(_SEPARATORS.get(separator, r"\s+"), text)
    return cells if separator == "," else [cell.replace(",", ".") for cell in cells]


def _number(cell: str, where: str) -> float:
    try:
        return float(cell.replace("_", "?"))  # which Python takes for nothing
    except ValueError:
        raise InputError(f"{where} is '{cell[:40]}', but must be a number; correct it") from None
