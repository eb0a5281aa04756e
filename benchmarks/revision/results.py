"""The commands that are run in both revisions, and the numbers of what they wrote."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from .differences import KINDS, Numbers, read
from .environment import Revision

FAR = "2,-1,1,.3,-.2,1,0,0,0,0,0,0"
MOVING = "-0.5,0.8,-0.3,0.05,0.1,-0.6,0.2,-0.1,0.15,0.1,-0.05,0.2"
# old setting -> new setting: tried where a command is refused with the old one
RENAMED_SETTINGS: dict[str, str] = {}


def _sets(*settings: str) -> tuple[str, ...]:
    return tuple(word for setting in settings for word in ("--set", setting))


DISTURBED = _sets("simulation.mode=disturbed", "simulation.disturbance.kind=waves")
IMPERFECT = _sets(
    *("simulation.thruster_limits=true", "simulation.observer_bandwidth=1"),
    *("simulation.noise.position=0.01", "simulation.noise.velocity=0.01"),
)
SHORT = _sets("simulation.duration=20")
# each is run in a folder of its own, beside those of the others
COMMANDS: dict[str, tuple[str, ...]] = {
    "check": ("check",),
    "online": ("online",),
    "online-checked": ("check", "--run", "../online/out/learned.nc"),
    "online-rexrov": ("online", "rexrov", *SHORT),
    "online-buoyant": ("online", "bluerov2-heavy-buoyant", *SHORT),
    "online-waves": ("online", *DISTURBED),
    "online-imperfect": ("online", *DISTURBED, *IMPERFECT, *SHORT),
    "offline": ("offline",),
    "offline-states": ("offline", "--state", FAR, "--state", MOVING),
    "offline-saddle": ("offline", "--saddle", "--gammas", "1.5,3"),
    "compare": ("compare", "--n-states", "2"),
    "compare-waves": ("compare", "--n-states", "1", *DISTURBED, *SHORT),
    "sweep": (
        *("sweep", "--states", "2", "--scales", "0.35,1.0"),
        *("--policies", "learned,linear,gradient,lqr,pid,mpc"),
    ),
}
ANSWER, MESSAGES, KEPT = "answer.json", "messages.txt", "kept.json"


def run_all(revision: Revision) -> None:
    """Run every command, but not those whose results are already there."""
    for name, words in COMMANDS.items():
        folder = revision.folder / "results" / name
        if not _is_kept(folder, words):
            _run(revision, name, words, folder)


def _is_kept(folder: Path, words: tuple[str, ...]) -> bool:
    try:
        return bool(json.loads((folder / KEPT).read_text(encoding="utf-8"))["asked"] == list(words))
    except (OSError, ValueError, KeyError):
        return False


def _run(revision: Revision, name: str, words: tuple[str, ...], folder: Path) -> None:
    print(f"{revision.label}: {name} ...", file=sys.stderr, flush=True)
    started = time.perf_counter()
    code = _call(revision, words, folder)
    renamed = tuple(_renamed(word) for word in words)
    if code == 2 and renamed != words:
        code = _call(revision, renamed, folder)
    kept = {"asked": words, "code": code, "seconds": time.perf_counter() - started}
    (folder / KEPT).write_text(json.dumps(kept), encoding="utf-8")


def _renamed(word: str) -> str:
    setting, equals, value = word.partition("=")
    return RENAMED_SETTINGS.get(setting, setting) + equals + value


def _call(revision: Revision, words: tuple[str, ...], folder: Path) -> int:
    """Run a command in an empty folder and return its exit code."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    line = [str(revision.command), *words, "--json", "--out", "out"]
    with (folder / ANSWER).open("wb") as answer, (folder / MESSAGES).open("wb") as messages:
        return subprocess.run(
            line, cwd=folder, env=revision.variables, stdout=answer, stderr=messages, check=False
        ).returncode


def numbers(revision: Revision, name: str) -> dict[str, Numbers]:
    """Return the numbers of a command by kind of file; the exit code is one of them."""
    folder = revision.folder / "results" / name
    found: dict[str, Numbers] = {"JSON": read(folder / ANSWER, ANSWER)}
    found["JSON"][ANSWER, "exit code"] = np.array(_code(folder))
    labels = _labels(folder)
    for path in sorted((folder / "out").rglob("*")):
        if path.suffix in KINDS:
            relative = path.relative_to(folder).as_posix()
            own = read(path, labels.get(relative, relative))
            found.setdefault(KINDS[path.suffix], {}).update(own)
    return found


def _labels(folder: Path) -> dict[str, str]:
    """Return what the records of a sweep, named after hashes, are called here: after their runs."""
    table = folder / "out" / "sweep.csv"
    if not table.is_file():
        return {}
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {f"out/{row['record']}": f"out/run {row['run']}" for row in rows if row.get("record")}


def _code(folder: Path) -> int:
    return int(json.loads((folder / KEPT).read_text(encoding="utf-8"))["code"])


def fault(revision: Revision, name: str) -> str | None:
    """Return in a sentence that a command gave no results, and why; None if it gave some."""
    folder = revision.folder / "results" / name
    code = _code(folder)
    if code in (0, 1) and (folder / ANSWER).stat().st_size:
        return None
    lines = (folder / MESSAGES).read_text(encoding="utf-8", errors="replace").split("\n")
    last = next((line for line in reversed(lines) if line.strip()), "no message")
    return f"{revision.label}: '{name}' ended with exit code {code} and no results: {last}"
