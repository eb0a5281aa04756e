"""What the commands print: tables and one JSON object on stdout, progress on stderr."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..comparison import Scenario
from ..online.records import writable_folder, write_text, written_whole
from . import interrupt

SECONDS_BETWEEN_NOTES = 10.0


class Tell(Protocol):
    """Show the name of the present stage, the part of it that is done, 0 to 1, and a note on it."""

    def __call__(self, stage: str, part: float, note: str = "") -> None:
        """Update the progress line."""
        ...


def load_scenario(options: argparse.Namespace) -> Scenario:
    """Return the scenario of the command line, its vehicle and game checked; raises InputError."""
    scenario = Scenario.load(options.scenario, options.overrides, getattr(options, "vary", ()))
    scenario.setup()
    scenario.initial_weights()
    scenario.critic_law()
    interrupt.check()
    return scenario


def output_folder(options: argparse.Namespace) -> Path:
    """Return --out, or results/<scenario>, once it is sure that files can be written there.

    Raises
    ------
    InputError
        If they can't.
    """
    chosen: Path | None = options.out
    return writable_folder(
        chosen if chosen is not None else Path("results") / Path(options.scenario).stem
    )


@contextmanager
def progress(options: argparse.Namespace) -> Iterator[Tell]:
    """Yield a function that shows the present stage on stderr; silent with --quiet.

    It is also where a Ctrl-C that got lost is noticed.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}"),
    )
    console = Console(stderr=True)
    if not console.is_terminal or options.quiet:
        yield _silent if options.quiet else _line_by_line()
        return
    with Progress(*columns, console=console, transient=True) as bar:
        tasks: dict[str, Any] = {}

        def tell(stage: str, part: float, note: str = "") -> None:
            interrupt.check()
            if stage not in tasks:
                for task in tasks.values():
                    bar.update(task, completed=1.0)
                tasks[stage] = bar.add_task(stage, total=1.0, note=note)
            bar.update(tasks[stage], completed=part, note=note)

        yield tell


def _silent(stage: str, part: float, note: str = "") -> None:
    """Show nothing."""
    interrupt.check()


def _line_by_line() -> Tell:
    """Return what shows each new stage, and now and then its note, where there is no terminal."""
    shown: dict[str, float] = {}

    def tell(stage: str, part: float, note: str = "") -> None:
        interrupt.check()
        now = time.monotonic()
        if stage not in shown:
            print(f"stationkeep: {stage} ...", file=sys.stderr, flush=True)
        elif note and now - shown[stage] > SECONDS_BETWEEN_NOTES:
            print(f"stationkeep: {stage}: {note}", file=sys.stderr, flush=True)
        else:
            return
        shown[stage] = now

    return tell


def print_json(data: dict[str, Any]) -> None:
    """Print one JSON object; numbers that are not finite become null."""
    print(json.dumps(plain(data)))


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write what `print_json` prints to a file, indented; raises as `written_whole`."""
    write_text(path, json.dumps(plain(data), indent=1))


def write_json_rows(
    path: Path, name: str, rows: Iterable[dict[str, Any]], rest: dict[str, Any]
) -> None:
    """Write {name: [rows ...], **rest} as `write_json` would, a row at a time, a line each."""
    with written_whole(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write(f"{{{json.dumps(name)}: [")
        for i, row in enumerate(rows):
            file.write((",\n" if i else "\n") + json.dumps(plain(row)))
        file.write("\n]")
        for key, value in rest.items():
            file.write(f",\n{json.dumps(key)}: {json.dumps(plain(value))}")
        file.write("}\n")


def print_file(path: Path) -> None:
    """Print a JSON file as `print_json` prints an object, on one line."""
    with path.open(encoding="utf-8") as file:
        for line in file:
            sys.stdout.write(line.rstrip("\n"))
    print()


def plain(value: Any) -> Any:
    """Return a value as JSON knows it."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def print_table(title: str, header: Iterable[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table on stdout; columns of numbers are aligned on the right."""
    console = Console(width=None if sys.stdout.isatty() else 150, highlight=False)
    table = Table(title=title, title_justify="left", title_style="bold")
    listed = [[str(cell) for cell in row] for row in rows]
    for i, name in enumerate(header):
        numbers = all(row[i][:1] in "0123456789-–" for row in listed)
        table.add_column(escape(name), justify="right" if numbers else "left", overflow="fold")
    for row in listed:
        table.add_row(*(escape(cell) for cell in row))
    console.print(table)
