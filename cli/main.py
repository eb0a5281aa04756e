"""`stationkeep COMMAND [SCENARIO]`: parse, run, and turn errors into one sentence and an exit code.

0: done; 1: a run that did not converge or a certificate that failed, its results still written; 2: bad
input. Nothing heavy is imported before a command is chosen.
"""

from __future__ import annotations

import argparse
import importlib
import io
import logging
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from . import interrupt

COMMANDS = {
    "generate": "write, compile and verify the model functions of a scenario",
    "online": "run the online learner in closed loop",
    "offline": "solve for the certified offline optimum of the same game",
    "compare": "run both and write figures, tables and an HTML report",
    "check": "list the paper's assumptions and conditions with their numbers",
    "sweep": "run policies over many states, settings and vehicle parameters, into one table",
    "replay": "run a record again and say whether its numbers come out again",
    "export": "write a record as a .mat file for MATLAB",
}
RECORD_COMMANDS = ("replay", "export")
DEFAULT_SCENARIO = "bluerov2-heavy"
GAMMAS_HELP = "also the value at these attenuation levels, or at 12 of them: 'grid'"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    # one BLAS thread: the matrices are small, and the numbers don't depend on the number of cores
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that does not know Greek shows '?'
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = parser().parse_args(_joined(given))
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("stationkeep: %(message)s"))
    logger = logging.getLogger("stationkeep")
    logger.addHandler(handler)
    try:
        with interrupt.remembered():
            return _run(options)
    except BrokenPipeError:  # what reads our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        print("stationkeep: interrupted; what was finished is kept", file=sys.stderr)
        return 1
    finally:
        logger.removeHandler(handler)


def _run(options: argparse.Namespace) -> int:
    from ..symbolic.errors import InputError, StationkeepError

    try:
        module = importlib.import_module(f".{options.command}", __package__)
        return int(module.run(options))
    except InputError as error:
        print(f"stationkeep: {error}", file=sys.stderr)
        return 2
    except StationkeepError as error:
        print(f"stationkeep: {error}", file=sys.stderr)
        return 1


class _Parser(argparse.ArgumentParser):
    """A parser whose error is one sentence."""

    def error(self, message: str) -> None:  # type: ignore[override]
        self.exit(2, f"stationkeep: {message}; see '{self.prog} --help'\n")


class _Version(argparse.Action):
    """Print the installed version; looked up only when it is asked for."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str | None = None) -> None:
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print and exit."""
        print(f"stationkeep {version('stationkeep')}")
        parser.exit()


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    top = _Parser(
        prog="stationkeep",
        description="Station keeping of underwater vehicles by an online-learned H-infinity policy, "
        "beside the certified optimum of the same game.",
    )
    top.add_argument("--version", action=_Version, help="print the version and exit")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, purpose in COMMANDS.items():
        command = commands.add_parser(
            name, help=purpose, description=purpose[0].upper() + purpose[1:] + "."
        )
        if name in RECORD_COMMANDS:
            _record_options(command, name)
            continue
        _common_options(command)
        if name == "generate":
            command.add_argument(
                "--virtual-machine",
                action="store_true",
                help="don't compile, use CasADi's virtual machine",
            )
        if name == "offline":
            _offline_options(command)
        if name == "sweep":
            _sweep_options(command)
        if name == "check":
            _check_options(command)
        if name == "compare":
            _compare_options(command)
    return top


def _compare_options(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--n-states",
        type=int,
        default=10,
        metavar="N",
        help="compare from N states: the scenario's, and N - 1 of the envelope (default: 10)",
    )
    command.add_argument(
        "--field",
        default="x,y",
        metavar="STATE,STATE",
        help="draw the Bellman error over these two states (default: x,y)",
    )
    command.add_argument(
        "--animation",
        action="store_true",
        help="also a film of learned beside optimal, MP4 with ffmpeg, else GIF",
    )
    _workers_option(command)


def _workers_option(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="processes that work at the same time (default: as many as there are cores)",
    )


def _check_options(command: argparse.ArgumentParser) -> None:
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


def _offline_options(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--state",
        action="append",
        metavar="X,Y,Z,PHI,...",
        help="initial state, 12 numbers [m, rad, m/s, rad/s] (repeatable)",
    )
    command.add_argument(
        "--states", type=Path, metavar="FILE", help=".npy or CSV file of rows of 12 numbers"
    )
    command.add_argument("--gammas", metavar="G,G,...", help=GAMMAS_HELP)
    command.add_argument(
        "--saddle",
        action="store_true",
        help="also the best responses of both players, and the linear policy's worst case",
    )
    _workers_option(command)
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


def _sweep_options(command: argparse.ArgumentParser) -> None:
    options: dict[str, tuple[str, str]] = {
        "--policies": ("NAME,...", "what drives the vehicle (default: learned,linear)"),
        "--states": ("N|FILE", "N random states of the envelope, or a .npy or CSV file of rows of 12"),
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


def _record_options(command: argparse.ArgumentParser, name: str) -> None:
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
    else:
        command.add_argument(
            "--out", type=Path, metavar="FILE", help="file to write (default: RECORD with .mat)"
        )
    _output_options(command)


def _common_options(command: argparse.ArgumentParser) -> None:
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
    _output_options(command)


def _output_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("--json", action="store_true", help="print one JSON object on stdout")
    command.add_argument("--quiet", action="store_true", help="no progress on stderr")


def _joined(arguments: list[str]) -> list[str]:
    """Join `--state`, `--gammas` and `--set` with their value, which may begin with a minus sign."""
    joined, i = [], 0
    while i < len(arguments):
        if arguments[i] in ("--state", "--gammas", "--set") and i + 1 < len(arguments):
            joined.append(f"{arguments[i]}={arguments[i + 1]}")
            i += 1
        else:
            joined.append(arguments[i])
        i += 1
    return joined


if __name__ == "__main__":
    sys.exit(main())
