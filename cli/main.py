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

from . import interrupt
from .options import (
    check_options,
    common_options,
    compare_options,
    offline_options,
    record_options,
    sweep_options,
)

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
    from ..symbolic import InputError, StationkeepError

    try:
        module = importlib.import_module(f".commands.{options.command}", __package__)
        return int(module.run(options))
    except StationkeepError as error:
        # a user's words may have lines of their own
        print(f"stationkeep: {' '.join(str(error).split())}", file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    except BrokenPipeError:
        raise
    except Exception as error:
        print(f"stationkeep: {_unforeseen(error)}", file=sys.stderr)
        return 1


def _unforeseen(error: Exception) -> str:
    """Keep the traceback of a fault of the program in a file, and return a sentence that names it."""
    import tempfile
    import traceback

    kind = f"{type(error).__name__} came up that was not foreseen"
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="stationkeep-", suffix=".txt", delete=False, encoding="utf-8"
        ) as file:
            file.write("".join(traceback.format_exception(error)))
    except OSError:
        return f"{kind}, a fault of the program: {' '.join(str(error).split())[:200]}"
    return f"{kind}, a fault of the program; its traceback is in '{file.name}', please send it to us"


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
            record_options(command, name)
            continue
        common_options(command)
        if name == "generate":
            command.add_argument(
                "--virtual-machine",
                action="store_true",
                help="don't compile, use CasADi's virtual machine",
            )
        if name == "offline":
            offline_options(command)
        if name == "sweep":
            sweep_options(command)
        if name == "check":
            check_options(command)
        if name == "compare":
            compare_options(command)
    return top


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
