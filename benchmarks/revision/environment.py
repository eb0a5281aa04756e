"""A revision in an environment of its own: a clean export, installed as a user installs it."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parents[2]
LISTED = "packages.txt"  # written last: an environment that has it is whole


@dataclass(frozen=True)
class Revision:
    """A commit, and the folder that holds its export, environment, cache and results.

    Attributes
    ----------
    label : OLD or NEW
    """

    label: str
    commit: str
    folder: Path

    @property
    def python(self) -> Path:
        """The interpreter of its environment."""
        return self.folder / "venv" / "bin" / "python"

    @property
    def command(self) -> Path:
        """Its `stationkeep` script."""
        return self.python.with_name("stationkeep")

    @property
    def variables(self) -> dict[str, str]:
        """Environment variables of its processes: a cache of its own, one thread, no other modules."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "STATIONKEEP"))}
        own = {"STATIONKEEP_CACHE": str(self.folder / "cache"), "MPLBACKEND": "Agg"}
        return kept | own | {"OMP_NUM_THREADS": "1"}

    @property
    def packages(self) -> list[str]:
        """The packages that it is installed with, with their versions."""
        return (self.folder / LISTED).read_text(encoding="utf-8").splitlines()


def revisions(old: str, new: str, folder: Path) -> tuple[Revision, Revision]:
    """Return both revisions; the same commit twice has two folders, to see what chance does."""
    commits = [_commit(name) for name in (old, new)]
    again = "-again" if commits[0] == commits[1] else ""
    names = commits[0][:12], commits[1][:12] + again
    labels = ("OLD", "NEW")
    first, second = (
        Revision(label, commit, folder.resolve() / name)
        for label, commit, name in zip(labels, commits, names, strict=True)
    )
    return first, second


def _commit(name: str) -> str:
    done = _git("rev-parse", "--verify", "--quiet", f"{name}^{{commit}}")
    if done.returncode != 0:
        stop(f"there is no revision '{name}' in the repository of this script; give a commit or a tag")
    return done.stdout.decode().strip()


def is_changed() -> bool:
    """Return whether the working tree has changes that are in no commit."""
    return bool(_git("status", "--porcelain").stdout.strip())


def _git(*words: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, check=False)


def make(revision: Revision) -> None:
    """Export and install a revision, unless it is already there."""
    if (revision.folder / LISTED).is_file():
        return
    print(f"{revision.label}: installing {revision.commit[:12]} ...", file=sys.stderr, flush=True)
    source = revision.folder / "source"
    shutil.rmtree(source, ignore_errors=True)
    archive = _git("archive", "--format=tar", revision.commit)
    with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as tar:
        tar.extractall(source, filter="data")
    venv = str(revision.folder / "venv")
    _install([sys.executable, "-m", "venv", "--clear", venv], source)
    pip = [str(revision.python), "-m", "pip"]
    _install([*pip, "install", "--quiet", "."], source)
    listed = _install([*pip, "freeze", "--exclude", "stationkeep"], source)
    (revision.folder / LISTED).write_text(listed, encoding="utf-8")


def _install(words: list[str], folder: Path) -> str:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        stop(f"{' '.join(words)} failed:\n{done.stderr.strip()[-2000:]}")
    return done.stdout


def stop(text: str) -> NoReturn:
    """Say why there can be no comparison, and end with exit code 2."""
    print(text, file=sys.stderr)
    raise SystemExit(2)
