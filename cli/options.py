"""The options of each command; nothing heavy is imported here."""

from __future__ import annotations

import argparse
from pathlib import Path

DEFAULT_SCENARIO = "bluerov2-heavy"
GAMMAS_HELP = "also the value at these attenuation levels, or at 12 of them: 'grid'"


def compare_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `compare`."""
    command.add_argument(
        "--n-states",
        type=int,
        default=10,
        metavar="N",
        help="compare from N states: the scenario's, and N - 1 of the envelope (default: 10)",
    )
    command.add_argument(
        "--policy",
        action="append",
        default=[],
        metavar="FILE.py:MAKE",
        help="also a control law of your own, make(setup) in a Python file (repeatable)",
    )
    command.add_argument(
        "--field",
        metavar="STATE,STATE",
        help="draw the Bellman error over these two states (default: the first two, x,y)",
    )
    command.add_argument(
        "--animation",
        action="store_true",
        help="also a film of learned beside optimal, MP4 with ffmpeg, else GIF",
    )
    workers_option(command)


def workers_option(command: argparse.ArgumentParser) -> None:
    """Add --workers."""
    command.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="processes that work at the same time (default: as many as there are cores)",
    )


def check_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `check`."""
    command.add_argument(
        "--ideal-weights",
        type=Path,
        metavar="FILE",
        help="ideal-weights.nc of 'offline --ideal-weights', for what needs ε and ε'",
    )
    command.add_argument(
        "--run",
        type=Path,
        metavar="FILE",
        help="learned.nc of 'online' or 'compare': check that run, with its own scenario",
    )


def offline_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `offline`."""
    command.add_argument(
        "--state",
        action="append",
        metavar="X,Y,Z,PHI,...",
        help="initial state, one number for each state (repeatable)",
    )
    command.add_argument(
        "--states", type=Path, metavar="FILE", help=".npy or CSV file, a row for each initial state"
    )
    command.add_argument("--gammas", metavar="G,G,...", help=GAMMAS_HELP)
    command.add_argument(
        "--saddle",
        action="store_true",
        help="also the best responses of both players, and the linear policy's worst case",
    )
    workers_option(command)
    command.add_argument(
        "--ideal-weights",
        type=int,
        metavar="N",
        help="fit the basis to the certified optima from N seeded states of the envelope",
    )
    command.add_argument(
        "--held-out",
        type=int,
        metavar="M",
        help="states of their own on which the fit is judged (default: N / 4, at least 10)",
    )


def sweep_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `sweep`."""
    options: dict[str, tuple[str, str]] = {
        "--policies": ("NAME,...", "what drives the plant, FILE.py:MAKE too (default: learned,linear)"),
        "--states": ("N|FILE", "N random states of the envelope, or a .npy or CSV file, a row each"),
        "--scales": ("S,S,...", "parts of the envelope; the same as --vary envelope.scale=S,S,..."),
        "--sampling": ("KIND", "of ranges: random, latin (default) or sobol"),
        "--samples": ("N", "number of points at which the ranges are sampled"),
        "--seed": ("N", "of states and samples (default: the scenario's simulation.seed)"),
        "--workers": ("N", "processes (default: as many as there are cores)"),
        "--cluster": ("URL", "scheduler of a dask cluster that does the runs, tcp://HOST:8786"),
        "--records": ("WHICH", "runs of which records are kept: all (default), failed or none"),
        "--every": ("SECONDS", "between the kept points of a record, 0 for all (default: 0.2)"),
    }
    numbers = {"--samples": int, "--seed": int, "--workers": int, "--every": float}
    words = {"--sampling": ("random", "latin", "sobol"), "--records": ("all", "failed", "none")}
    defaults = {
        "--policies": "learned,linear",
        "--sampling": "latin",
        "--records": "all",
        "--every": 0.2,
    }
    command.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="v1,v2,... takes each value, low:high or low:high:log is sampled; KEY is section.key, "
        "section.key[i], vehicle.KEY, plant.KEY or either with .factor (repeatable)",
    )
    for name, (metavar, text) in options.items():
        command.add_argument(
            name,
            metavar=metavar,
            help=text,
            type=numbers.get(name, str),
            choices=words.get(name),
            default=defaults.get(name),
        )


def record_options(command: argparse.ArgumentParser, name: str) -> None:
    """Add the options of a command that reads a record."""
    command.add_argument("record", type=Path, metavar="RECORD", help="netCDF file of a run (.nc)")
    if name == "replay":
        command.add_argument("--out", type=Path, metavar="FILE", help="also keep the new record here")
        command.add_argument(
            "--tolerance",
            type=float,
            default=1e-6,
            metavar="X",
            help="relative difference up to which numbers count as equal (default: 1e-6)",
        )
        command.add_argument(
            "--policy",
            metavar="FILE.py:MAKE",
            help="the program of one's own that the run had; without it its inputs are played back",
        )
    else:
        command.add_argument(
            "--out", type=Path, metavar="FILE", help="file to write (default: RECORD with .mat)"
        )
    output_options(command)


def common_options(command: argparse.ArgumentParser) -> None:
    """Add the scenario and what every command with one has."""
    command.add_argument(
        "scenario",
        nargs="?",
        default=DEFAULT_SCENARIO,
        help=f"a shipped name or the path of a TOML file (default: {DEFAULT_SCENARIO})",
    )
    command.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENARIO)"
    )
    command.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="change a setting of the scenario (repeatable)",
    )
    output_options(command)


def output_options(command: argparse.ArgumentParser) -> None:
    """Add how results are told."""
    command.add_argument("--json", action="store_true", help="print one JSON object on stdout")
    command.add_argument("--quiet", action="store_true", help="no progress on stderr")
