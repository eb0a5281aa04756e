"""The `stationkeep` command as a user runs it, and what a message to a user must look like."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from stationkeep.cli.main import main

# overrides that make a run quick: 78 functions, 200 samples, 2 s, and a short coarse optimum
QUICK = ("basis.name=quadratic", "samples.number=200", "simulation.duration=2")
COARSE = ("offline.horizon=40", "offline.intervals=20")
# an optimum that is quicker still, and tolerances that its certificate meets
ROUGH = ("offline.horizon=20", "offline.intervals=8", "offline.aligned=false")
LOOSE = tuple(f"offline.{name}_tolerance=1" for name in ("value", "defect", "hji", "costate"))

# words of Python and of libraries that mean nothing to somebody who typed a command
JARGON = (
    *("Traceback", "pydantic", "[type=", "Input should", "validation", "list[", "Tuple", "tuple"),
    *("dictionary", "instance of", "unable to parse", "Errno", "codec", "pickle", "usecols"),
    *("float64", "sblock", "synchronously", "inhomogeneous", "Warning", "NoneType", "ndarray"),
)


@dataclass(frozen=True)
class Answer:
    """What a command left behind: exit code, stdout and stderr."""

    code: int
    out: str
    err: str

    def json(self) -> dict[str, Any]:
        """Return stdout as the one JSON object that it must be."""
        answer = json.loads(self.out)
        assert isinstance(answer, dict)
        return answer

    def sentence(self) -> str:
        """Return the one sentence on stderr, after checking that it is one and for a user."""
        lines = self.err.splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("stationkeep: "), self.err
        text = lines[0].removeprefix("stationkeep: ")
        assert 10 < len(text) <= 400, text
        for word in JARGON:
            assert word not in text, text
        return text


def sets(*overrides: str) -> list[str]:
    """Return `--set override` for each."""
    return [word for override in overrides for word in ("--set", override)]


@cache
def script() -> str:
    """Return the path of the installed `stationkeep` script."""
    found = shutil.which("stationkeep", path=str(Path(sys.executable).parent))
    found = found or shutil.which("stationkeep")
    assert found, "the package is not installed: there is no 'stationkeep' script"
    return found


def run(
    *arguments: str,
    cwd: Path,
    env: Mapping[str, str] | None = None,
    timeout: float = 300.0,
    preexec_fn: Callable[[], object] | None = None,
) -> Answer:
    """Run the installed script in `cwd` and wait for it."""
    done = subprocess.run(
        [script(), *arguments],
        cwd=cwd,
        env=env,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=timeout,
        preexec_fn=preexec_fn,
        check=False,
    )
    return Answer(done.returncode, done.stdout, done.stderr)


def call(capsys: pytest.CaptureFixture[str], *arguments: str) -> Answer:
    """Call what the script calls in this process, in the present folder."""
    capsys.readouterr()
    try:
        code = main(list(arguments))
    except SystemExit as stop:
        code = int(stop.code or 0)
    captured = capsys.readouterr()
    return Answer(code, captured.out, captured.err)


def files_in(folder: Path) -> list[str]:
    """Return the paths of all files below a folder, hidden ones included."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
