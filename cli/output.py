"""What the commands print: tables and one JSON object on stdout, progress on stderr."""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
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
from ..online.record import write_text
from ..symbolic import InputError
from . import interrupt


class Tell(Protocol):
    """Show the name of the present stage and the part of it that is done, 0 to 1."""

    def __call__(self, stage: str, part: float) -> None:
        """Update the progress line."""
        ...


def load_scenario(options: argparse.Namespace) -> Scenario:
    """Return the scenario of the command line, its vehicle and game checked; raises InputError."""
    scenario = Scenario.load(options.scenario, options.overrides)
    scenario.station_keeping()
    scenario.initial_weights()
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
    folder = chosen if chosen is not None else Path("results") / Path(options.scenario).stem
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise InputError(
            f"the folder '{folder}' can't be written ({error.strerror}); choose another one with --out"
        ) from None


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
    )
    console = Console(stderr=True)
    if not console.is_terminal or options.quiet:
        yield _silent if options.quiet else _line_by_line()
        return
    with Progress(*columns, console=console, transient=True) as bar:
        tasks: dict[str, Any] = {}

        def tell(stage: str, part: float) -> None:
            interrupt.check()
            if stage not in tasks:
                for task in tasks.values():
                    bar.update(task, completed=1.0)
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=part)

        yield tell


def _silent(stage: str, part: float) -> None:
    """Show nothing."""
    interrupt.check()


def _line_by_line() -> Tell:
    """Return what shows each new stage as a line, where there is no terminal to draw on."""
    seen: set[str] = set()

    def tell(stage: str, part: float) -> None:
        interrupt.check()
        if stage not in seen:
            seen.add(stage)
            print(f"stationkeep: {stage} ...", file=sys.stderr, flush=True)

    return tell


def print_json(data: dict[str, Any]) -> None:
    """Print one JSON object; numbers that are not finite become null."""
    print(json.dumps(plain(data)))


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write what `print_json` prints to a file, indented; raises as `written_whole`."""
    write_text(path, json.dumps(plain(data), indent=1))


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
