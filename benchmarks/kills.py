"""Commands killed at random moments, then run to their end: nothing lost, nothing left over.

python benchmarks/kills.py [--kills N] [--seed N]

`generate`, `offline`, `sweep` and `compare` take turns. Each is killed (SIGKILL, its workers too) again
and again in one folder, with one cache, until it comes to its end, and then anew. Printed: what is left
over then (temporary files, locks, builds), what differs from a run that nobody disturbed (rows, values,
files), and what was finished before a kill and made anew after it.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

SHORT = ("basis.name='quadratic'", "samples.number=20", "simulation.duration=1")
ROUGH = ("offline.horizon=20", "offline.intervals=8", "offline.aligned=false", "offline.rounds=1")
STATES = "0.3,0,0,0,0,0,0,0,0,0,0,0"
WORDS: dict[str, tuple[str, ...]] = {
    "generate": (),
    "offline": (
        "--workers",
        "1",
        *(part for x in "123" for part in ("--state", STATES.replace("3", x))),
    ),
    "sweep": ("--workers", "2", "--states", "4", "--policies", "learned,linear"),
    "compare": ("--workers", "2", "--n-states", "2"),
}


def started(command: str, folder: Path) -> subprocess.Popen[bytes]:
    """Start a command in a process group of its own."""
    words = [
        sys.executable,
        "-m",
        "stationkeep.cli.main",
        command,
        *WORDS[command],
        "--quiet",
        "--json",
    ]
    for text in (*SHORT, *ROUGH):
        words += ["--set", text]
    env = os.environ | {"STATIONKEEP_CACHE": str(folder / "cache"), "MPLBACKEND": "Agg"}
    return subprocess.Popen(
        words,
        cwd=folder,
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def finished(command: str, folder: Path) -> tuple[dict[str, Any], float]:
    """Run a command to its end, and return its JSON and how long it took [s]."""
    began = time.monotonic()
    process = started(command, folder)
    out, err = process.communicate()
    if process.returncode not in (0, 1) or not out.strip():
        raise SystemExit(f"{command} ended with {process.returncode}: {err.decode()}")
    return json.loads(out), time.monotonic() - began


def killed(command: str, folder: Path, after: float) -> bool:
    """Kill a command after some time [s]; return whether it was still there."""
    process = started(command, folder)
    try:
        process.communicate(timeout=after)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    return False


def kept(folder: Path) -> dict[str, bytes]:
    """Return the records that are whole by their names: a new one has another time of change."""
    return {
        str(path.relative_to(folder)): str(path.stat().st_mtime_ns).encode()
        for path in folder.glob("results/**/*.nc")
        if not path.name.startswith(".") and path.name != "sweep.nc"
    }


def left_over(folder: Path) -> list[str]:
    """Return temporary files, locks and unfinished builds."""
    found = [path for path in folder.rglob("*") if path.name.startswith(".")]
    return [str(path.relative_to(folder)) for path in found]


def names(folder: Path) -> set[str]:
    """Return the results by their names."""
    return {str(path.relative_to(folder)) for path in folder.glob("results/**/*") if path.is_file()}


def numbers(answer: Any) -> Any:
    """Return what of an answer does not depend on the clock or on what was there before."""
    if isinstance(answer, dict):
        clocks = ("cache_hit", "resumed", "policy_mean")
        return {
            key: numbers(value)
            for key, value in answer.items()
            if key not in clocks and not key.endswith("seconds")
        }
    return [numbers(entry) for entry in answer] if isinstance(answer, list) else answer


def try_command(command: str, n: int, rng: np.random.Generator) -> list[str]:
    """Kill a command n times, and return what is wrong then."""
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as one:
        calm = Path(one)
        expected, seconds = finished(command, calm)
        n_killed = 0
        while n_killed < n:
            with tempfile.TemporaryDirectory() as other:
                folder, before = Path(other), dict[str, bytes]()
                while n_killed < n and killed(command, folder, float(rng.uniform(0.1, 0.9)) * seconds):
                    n_killed += 1
                    before, found = compared(command, before, kept(folder))
                    faults += found
                    print(f"{command}: {n_killed} of {n}", file=sys.stderr, flush=True)
                answer, _ = finished(command, folder)
                faults += compared(command, before, kept(folder))[1]
                if numbers(answer) != numbers(expected):
                    faults.append(f"{command}: the answer is another than that of the undisturbed run")
                faults += [f"{command}: only one has '{name}'" for name in names(calm) ^ names(folder)]
                faults += [f"{command}: '{name}' is left over" for name in left_over(folder)]
    return faults


def compared(
    command: str, before: dict[str, bytes], now: dict[str, bytes]
) -> tuple[dict[str, bytes], list[str]]:
    """Return what is kept now, and what was kept before and is not, or was made again."""
    lost = [name for name in before if before[name] != now.get(name)]
    return now, [f"{command}: '{name}' was lost or made again" for name in lost]


def main() -> int:
    """Try all commands; 1 if anything was lost or left over."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng, faults = np.random.default_rng(options.seed), list[str]()
    for command in WORDS:
        n = options.kills // len(WORDS)
        found = try_command(command, n, rng)
        print(f"{command:<10}{n:>4} kills{len(found):>4} faults", flush=True)
        faults += found
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
