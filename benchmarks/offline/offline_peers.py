"""Time and error of the offline optimum, solved again from a new state: ours beside other tools.

    python benchmarks/offline/offline_peers.py [--venvs DIR] [--yapss-python PATH] [--json FILE]

Every contender solves the single-player equivalent of the reference game on the BlueROV2 Heavy, with
the terminal cost ζ'P ζ, from (2, -1, 1, .3, -.2, 1, 0, ...) and six random states of the full envelope
(half-widths x U(-1, 1)). It builds its solver once; a state's time is the least of the rounds, which
alternate between the contenders, as other work on the machine only adds to it. Reference values come
from 80 intervals aligned with the velocity sign changes, a horizon of 120 s, solved through IPOPT.

The mesh of each contender is the cheapest found that brings the relative error of the value to 1e-6
(median) and 1e-5 (worst) over 60 other random states of the envelope, among 3 to 9 points an interval,
gradings of 5 to 7.5 and horizons of 53 to 65 s. Tuned to the seven states themselves it would be a
third smaller, and off by 3e-6 (median) elsewhere. The peers start from the linearised closed loop, a
product with matrices made in advance, and have default options but for what their files say; everybody
has one thread.

Peers are no dependencies of stationkeep. `--venvs DIR` makes what is missing of two environments in
DIR, or by hand, in the root folder:

    python -m venv DIR/peers && DIR/peers/bin/pip install -e . rockit-meco maptor
    python -m venv DIR/yapss && DIR/yapss/bin/pip install -e . yapss 'casadi<=3.7.2'

yapss needs an older CasADi than ours. Without `--venvs` peers are looked for where this script runs;
one that is missing or fails is a row with the reason. Opti and fatrop come with CasADi.

A further contender is a file in `peers/` with a function (problem, mesh) -> solve, and one entry below.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import datetime
import platform
import subprocess
import sys
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from peers.game import Mesh
from peers.worker import Contender, Worker, serve
from stationkeep.cli.output import write_json
from stationkeep.comparison import Scenario
from stationkeep.offline import DirectSolver
from stationkeep.symbolic import Problem

FLIPPED = Mesh(n_intervals=19, degree=4, grading=6.0, horizon=53.0)  # Radau points end an interval
STANDARD = Mesh(n_intervals=13, degree=6, grading=6.5, horizon=55.0)  # Radau points start it
# the first is the unit of the last column
CONTENDERS = (
    Contender("stationkeep, Newton", "direct:newton", FLIPPED, packages=("stationkeep", "casadi")),
    Contender("stationkeep, IPOPT", "direct:ipopt", FLIPPED, packages=("stationkeep", "casadi")),
    Contender("CasADi Opti, IPOPT", "opti:build", FLIPPED),
    Contender("CasADi, fatrop", "fatrop:build", FLIPPED),
    Contender("rockit", "rockit:build", FLIPPED, "peers", ("rockit-meco", "casadi")),
    Contender("yapss", "yapss:build", STANDARD, "yapss", ("yapss", "casadi")),
    Contender("maptor", "maptor:build", STANDARD, "peers", ("maptor", "casadi")),
)
ROOT = Path(__file__).resolve().parents[2]
# what pip is told in each environment, one command a line: a peer that fails leaves the others be
VENVS = {
    "peers": (("-e", str(ROOT)), ("rockit-meco",), ("maptor",)),
    "yapss": (("-e", str(ROOT), "yapss", "casadi<=3.7.2"),),
}
MEDIAN_GOAL, WORST_GOAL = 1e-6, 1e-5
ANSWER_LIMIT = 60.0  # [s] for a build or a round
ROUND_BUDGET = 25.0  # [s] after which a contender sits out


def reference_states(half_widths: np.ndarray) -> np.ndarray:
    """Return the seven initial states, shape (7, 12)."""
    first = [2.0, -1.0, 1.0, 0.3, -0.2, 1.0, 0, 0, 0, 0, 0, 0]
    random = half_widths * np.random.default_rng(0).uniform(-1.0, 1.0, (6, 12))
    return np.vstack([first, random])


def reference_values(problem: Problem, states: np.ndarray) -> tuple[np.ndarray, float]:
    """Return V at the states, and the largest relative gap to its re-integration."""
    solver = DirectSolver(problem, horizon=120.0, n_intervals=80, degree=5, method="ipopt")
    solutions = [solver.solve_aligned(zeta0)[0] for zeta0 in states]
    values = np.array([solution.value for solution in solutions])
    integrated = np.array([solution.reintegrated_value for solution in solutions])
    return values, float(np.abs(integrated / values - 1.0).max())


def interpreters(venvs: Path | None, yapss: Path | None) -> dict[str, str]:
    """Return the Python of each environment, made where it is missing."""
    found = dict.fromkeys(("own", *VENVS), sys.executable)
    for name, commands in VENVS.items():
        if venvs is None or (name == "yapss" and yapss is not None):
            continue
        folder = venvs / name
        scripts = folder / ("Scripts" if os.name == "nt" else "bin")
        found[name] = str(scripts / "python")
        if not folder.exists():
            print(f"making the environment {folder} ...", file=sys.stderr, flush=True)
            subprocess.run([sys.executable, "-m", "venv", folder], check=True)
            for command in commands:
                # what does not install is told by the row of its contender
                subprocess.run([found[name], "-m", "pip", "install", "-q", *command], check=False)
    if yapss is not None:
        found["yapss"] = str(yapss)
    return found


def measure(states: np.ndarray, pythons: dict[str, str], rounds: int) -> list[Worker]:
    """Run every contender in turn, `rounds` times as far as its time allows."""
    workers = []
    try:
        for contender in CONTENDERS:
            print(f"building {contender.name} ...", file=sys.stderr, flush=True)
            command = [pythons[contender.python], str(Path(__file__)), "--worker", contender.name]
            workers.append(Worker(contender, command, ANSWER_LIMIT))
        for i in range(rounds):
            print(f"round {i + 1} of {rounds} ...", file=sys.stderr, flush=True)
            for worker in workers:
                if worker.seconds < ROUND_BUDGET:
                    worker.run(states)
    finally:
        for worker in workers:
            worker.close()
    return workers


def summary(worker: Worker, reference: np.ndarray) -> dict[str, Any]:
    """Return a contender's row; errors are infinite where it failed."""
    contender = worker.contender
    row: dict[str, Any] = {
        "name": contender.name,
        "mesh": asdict(contender.mesh),
        "versions": worker.versions,
        "build_seconds": worker.build_seconds,
        "reason": worker.reason,
        "rounds": len(worker.rounds),
    }
    if not worker.rounds:
        return row
    seconds = np.min(worker.rounds, axis=0)
    values = np.array([np.inf if value is None else value for value in worker.values])
    errors = np.abs(values / reference - 1.0)
    return row | {
        "seconds": seconds,
        "median_seconds": float(np.median(seconds)),
        "worst_seconds": float(seconds.max()),
        "values": values,
        "value_errors": errors,
        "median_error": float(np.median(errors)),
        "worst_error": float(errors.max()),
        "reached": bool(np.median(errors) <= MEDIAN_GOAL and errors.max() <= WORST_GOAL),
    }


def show(rows: list[dict[str, Any]]) -> None:
    """Print the table."""
    header = f"{'':<21}{'mesh: K x d, grading, T':<25}{'build':>7}{'solve [ms]':>18}{'value error':>18}"
    print(f"{header}{'':>9}{'time':>8}")
    columns = f"{'':<46}{'[s]':>7}{'median':>10}{'worst':>8}{'median':>10}{'worst':>8}"
    print(f"{columns}{'reached':>9}{'x ours':>8}")
    ours = rows[0].get("median_seconds")
    for contender, row in zip(CONTENDERS, rows, strict=True):
        start = f"{row['name']:<21}"
        if "median_seconds" in row:
            ratio = f"{row['median_seconds'] / ours:.1f}" if ours else ""
            print(
                f"{start}{contender.mesh!s:<25}{row['build_seconds']:>7.2f}"
                f"{1e3 * row['median_seconds']:>10.1f}{1e3 * row['worst_seconds']:>8.1f}"
                f"{row['median_error']:>10.1e}{row['worst_error']:>8.1e}"
                f"{'yes' if row['reached'] else 'no':>9}{ratio:>8}"
            )
        if row["reason"]:
            print(f"{start}{row['reason']}")


def machine() -> dict[str, Any]:
    """Return processor, cores and load, without a name."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": models[0] if models else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan"),
    }


def main() -> None:
    """Measure all contenders and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--venvs", type=Path, metavar="DIR", help="folder of the peers' environments")
    parser.add_argument("--yapss-python", type=Path, metavar="PATH", help="a Python that has yapss")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to a file")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    station = Scenario.load("bluerov2-heavy").station_keeping()
    states = reference_states(station.half_widths)
    if arguments.worker is not None:
        contender = next(one for one in CONTENDERS if one.name == arguments.worker)
        serve(contender, station.problem, 0.5 * states[0])
        return
    pythons = interpreters(arguments.venvs, arguments.yapss_python)
    here = machine()
    workers = measure(states, pythons, arguments.rounds)
    print("solving the reference ...", file=sys.stderr, flush=True)
    reference, gap = reference_values(station.problem, states)
    rows = [summary(worker, reference) for worker in workers]
    date = datetime.datetime.now(tz=datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    versions = {"python": platform.python_version(), "numpy": version("numpy")}
    print(f"{here['processor']}, {here['cores']} cores, load {here['load']:.1f} at the start; {date}")
    print(f"{len(states)} states; least of up to {arguments.rounds} rounds; one thread")
    print(f"reference: re-integrated to a relative {gap:.0e}\n")
    show(rows)
    print(f"\npython {versions['python']}, numpy {versions['numpy']}")
    for row in [row for row in rows if row["versions"]]:
        print(f"{row['name']:<21}" + ", ".join(f"{k} {v}" for k, v in row["versions"].items()))
    if arguments.json is not None:
        data = {
            "machine": here,
            "date": date,
            "versions": versions,
            "states": states,
            "reference": {"values": reference, "integration_gap": gap},
            "contenders": rows,
        }
        write_json(arguments.json, data)


if __name__ == "__main__":
    main()
