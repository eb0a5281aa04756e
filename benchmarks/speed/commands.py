"""Wall time and memory of the commands a user types, as whole processes.

    python benchmarks/speed/commands.py [--runs 3]

Targets: `--help` under 1 s, `generate` cold under 15 s and warm under 2 s, `compare` on the default
scenario under 120 s on 2 cores, memory under 1 GB. Prints the median of the runs; a cold run starts
with an empty cache of compiled functions.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

COMMAND = str(Path(sys.executable).with_name("stationkeep"))
MEASURE = (
    "import resource, subprocess, sys;"
    "null = subprocess.DEVNULL;"
    "code = subprocess.run(sys.argv[1:], stdout=null, stderr=null).returncode;"
    "print(code, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
)


def measure(arguments: list[str], cache: Path) -> tuple[float, float]:
    """Return wall time [s] and peak memory [MB] of one command in an empty folder."""
    environment = os.environ | {"STATIONKEEP_CACHE": str(cache), "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        answer = subprocess.run(
            [sys.executable, "-c", MEASURE, COMMAND, *arguments],
            capture_output=True,
            text=True,
            env=environment,
            cwd=folder,
            check=True,
        )
        seconds = time.perf_counter() - started
    code, kilobytes = answer.stdout.split()
    if code != "0":
        raise SystemExit(f"{' '.join(arguments)} failed with exit code {code}")
    return seconds, int(kilobytes) / 1024


def main() -> None:
    """Measure every command and print one row each."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=3)
    runs = parser.parse_args().runs
    rows = [
        ("--help", ["--help"], False, 1.0),
        ("generate, cold", ["generate"], True, 15.0),
        ("generate, warm", ["generate"], False, 2.0),
        ("check, warm", ["check"], False, None),
        ("online, warm", ["online"], False, None),
        ("offline, warm", ["offline"], False, None),
        ("compare, cold", ["compare"], True, 120.0),
        ("compare, warm", ["compare"], False, 120.0),
    ]
    print(f"{'command':<18}{'median [s]':>12}{'worst [s]':>12}{'target [s]':>12}{'memory [MB]':>13}")
    with tempfile.TemporaryDirectory() as temporary:
        cache = Path(temporary) / "cache"
        for name, arguments, cold, target in rows:
            seconds, memory = [], []
            for _ in range(runs):
                if cold:
                    shutil.rmtree(cache, ignore_errors=True)
                taken, peak = measure(arguments, cache)
                seconds.append(taken)
                memory.append(peak)
            goal = "" if target is None else f"{target:.0f}"
            print(
                f"{name:<18}{statistics.median(seconds):>12.2f}{max(seconds):>12.2f}{goal:>12}"
                f"{max(memory):>13.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
