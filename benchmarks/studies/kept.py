"""Results of many tasks, run in parallel and kept one by one: a killed script goes on where it was."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from stationkeep.comparison.parallel import S, T, Work, run_tasks
from stationkeep.comparison.records import key_of as records_key_of
from stationkeep.symbolic import InputError

Result = dict[str, Any]
Progress = Callable[[int, int, int], None]
_PACKAGES = ("symbolic", "online", "offline", "comparison")
_SOURCES = (".py", ".c", ".toml")


@dataclass(frozen=True)
class Keep:
    """A file of results, one JSON object a line.

    Attributes
    ----------
    file : its path
    n_workers : processes that work on what is missing
    progress : called with the numbers of results that are there, that were made, and of all
    """

    file: Path
    n_workers: int = 1
    progress: Progress | None = None

    def results(
        self,
        setup: Callable[[S], Work[T, Result]],
        shipment: S,
        tasks: Sequence[T],
        keys: Sequence[str],
    ) -> list[Result]:
        """Return the result of every task, and append to the file those that are not in it.

        A task that its process did not survive has the result {"failure": why}, which is not kept.

        Parameters
        ----------
        setup, shipment, tasks : as `pool.run_tasks`; a task yields one result
        keys : of the tasks, hashes of all that a result depends on

        Raises
        ------
        InputError
            If the file can't be written.
        """
        kept = self.known()
        missing = [number for number, key in enumerate(keys) if key not in kept]
        there = len(keys) - len(missing)
        todo = [tasks[number] for number in missing]
        with closing(run_tasks(setup, shipment, todo, self.n_workers)) as events:
            for made, event in enumerate(events, 1):
                key = keys[missing[event.task]]
                if event.message is None:
                    kept[key] = {"failure": event.failure}
                else:
                    kept[key] = event.message
                    self._append({"key": key, **event.message})
                if self.progress is not None:
                    self.progress(there + made, made, len(keys))
        return [kept[key] for key in keys]

    def known(self) -> dict[str, Result]:
        """Return what is kept, by key, without a line that a killed process left unfinished."""
        kept = {}
        for line in self.file.read_bytes().splitlines() if self.file.is_file() else ():
            try:
                result = json.loads(line)
                kept[str(result.pop("key"))] = result
            except (ValueError, KeyError, AttributeError, TypeError):
                continue
        return kept

    def _append(self, entry: Result) -> None:
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            with self.file.open("a+b") as handle:
                whole = handle.seek(0, 2) == 0 or (handle.seek(-1, 2) >= 0 and handle.read(1) == b"\n")
                handle.write((b"" if whole else b"\n") + json.dumps(entry).encode() + b"\n")
        except OSError as error:
            raise InputError(
                f"'{self.file}' can't be written ({error.strerror}); choose another folder"
            ) from None


def key_of(*parts: object) -> str:
    """Return the hash of what a result depends on, our own sources among it."""
    return records_key_of(sources(), *map(str, parts))


@cache
def sources() -> str:
    """Return the hash of the sources of all that runs: of the package, and of this folder."""
    return digest(source_folders())


def source_folders() -> list[Path]:
    """Return the folders whose files decide what a result is.

    The command line is none of them, nor are the scripts: what they ask for is in the other parts of a
    key.
    """
    found = [Path(str(resources.files(f"stationkeep.{package}"))) for package in _PACKAGES]
    return [*found, Path(__file__).resolve().parent]


def digest(folders: Sequence[Path]) -> str:
    """Return the hash of names and contents of the source files in the folders and all below them."""
    found = hashlib.sha256()
    for folder in folders:
        files = sorted(path for path in folder.rglob("*") if path.suffix in _SOURCES)
        for path in files:
            content = path.read_bytes()
            head = f"{folder.name} {path.relative_to(folder).as_posix()} {len(content)}\0"
            found.update(head.encode() + content)
    return found.hexdigest()
