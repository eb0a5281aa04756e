"""Wrong inputs by the thousand: each is answered by one sentence or accepted, and soon.

python benchmarks/fuzz.py [--inputs N] [--flips N] [--seed N] [--accepted FILE]

Vehicles, scenarios, `--set`, files of states and of weights are made from good ones by seeded changes;
records have one bit flipped each and go through `replay`, `check --run`, `export`, and as weights. All
in this process, functions not compiled. Printed: how many were accepted and refused, and everything
that came up as anything else than one sentence, or took more than 20 s of processor time. `--accepted`
writes what was accepted, to be looked through for nonsense.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import contextlib
import io
import json
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from stationkeep.cli.main import main as command
from stationkeep.cli.states import initial_states
from stationkeep.comparison import Scenario
from stationkeep.symbolic import InputError
from studies.changed_inputs import Inputs

TOO_LONG = 20.0  # s of processor time
JARGON = ("Traceback", "pydantic", "[type=", "Errno", "h5py", "numpy.")


@dataclass
class Found:
    """What became of the inputs.

    Attributes
    ----------
    outcomes : how many of each kind of input were accepted, refused, or something else
    faults : what was answered by anything else than one sentence
    accepted : the inputs that were taken
    slowest : processor time and name of the input that took longest
    """

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    accepted: list[str] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "")


def answer(words: list[str]) -> tuple[int, str]:
    """Return exit code and standard error of a command; a failure may be told in its JSON instead."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = READ[words[0]](words[1:]) if words[0] in READ else command(words)
        except SystemExit as end:
            code = int(end.code or 0)
    said = err.getvalue()
    if code == 1 and not said and isinstance(json.loads(out.getvalue()), dict):
        said = "stationkeep: told in the JSON\n"
    return code, said


def refused(error: InputError) -> int:
    """Say what a command would say, and return its exit code."""
    print(f"stationkeep: {error}", file=sys.stderr)
    return 2


def states(words: list[str]) -> int:
    """Read states from the command line or a file, as `offline` does."""
    text, path = (words[1:], None) if words[0] == "--state" else (None, Path(words[1]))
    try:
        initial_states(argparse.Namespace(state=text, states=path), SHIPPED)
    except InputError as error:
        return refused(error)
    return 0


def loaded(words: list[str]) -> int:
    """Load a scenario with settings and set its problem up, as every command does."""
    pairs = [*zip(words, ["", *words], strict=False)]
    names = [word for word, before in pairs if "--set" not in (word, before)]
    sets = [word for word, before in pairs if before == "--set"]
    try:
        Scenario.load(names[0] if names else "bluerov2-heavy", sets).setup()
    except InputError as error:
        return refused(error)
    return 0


READ: dict[str, Callable[[list[str]], int]] = {"load": loaded, "states": states}
SHIPPED = Scenario.load()


def fault_of(code: int, said: str) -> str | None:
    """Return what is wrong with an answer, or None."""
    if code == 0:
        return None
    lines = [line for line in said.splitlines() if line.startswith("stationkeep: ")]
    if len(lines) != 1 or not said.rstrip().endswith(lines[0]):
        return f"exit {code} with {said[-300:]!r}"
    if "not foreseen" in said or any(word in said for word in JARGON):
        return said.strip()
    return None


def try_one(found: Found, kind: str, name: str, call: Callable[[], tuple[int, str]]) -> None:
    """Try an input, and note what becomes of it."""
    started = time.process_time()
    try:
        code, said = call()
        fault = fault_of(code, said)
    except BaseException:  # whatever it is, it is what is looked for
        code, fault = 1, traceback.format_exc()
    seconds = time.process_time() - started
    found.slowest = max(found.slowest, (seconds, name))
    if seconds > TOO_LONG:
        fault = fault or f"took {seconds:.0f} s of processor time"
    if fault is not None:
        found.faults.append(f"{kind}: {name}\n    {fault}")
    elif code == 0:
        found.accepted.append(f"{kind}: {name}")
    outcome = "fault" if fault else ("accepted", "failed", "refused")[min(code, 2)]
    found.outcomes[kind, outcome] += 1


def tries(inputs: Inputs, n: int, n_flips: int) -> Iterator[tuple[str, str, list[str]]]:
    """Yield kind, name and command of each input, its file written."""
    makers = (inputs.vehicle, inputs.scenario, inputs.override, inputs.states, inputs.weights)
    for i in range(n):
        make = makers[i % len(makers)]
        yield make.__name__, *make()
    for _ in range(n_flips):
        yield "record", *inputs.record()


def main() -> int:
    """Try them all; 1 if anything came up."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--inputs", type=int, default=2000)
    parser.add_argument("--flips", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--accepted", type=Path)
    options = parser.parse_args()
    found, number = Found(), options.inputs + options.flips
    os.environ["PATH"] = ""  # no compiler
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder, np.errstate(all="ignore"):
        os.environ["STATIONKEEP_CACHE"] = f"{folder}/cache"
        inputs = Inputs(Path(folder), options.seed)
        for i, (kind, name, words) in enumerate(tries(inputs, options.inputs, options.flips), 1):
            try_one(found, kind, name, lambda words=words: answer(words))  # type: ignore[misc]
            if i % 50 == 0:
                print(f"{i} of {number}, {len(found.faults)} faults", file=sys.stderr, flush=True)
    for (kind, outcome), count in sorted(found.outcomes.items()):
        print(f"{kind:<10}{outcome:<10}{count:>6}")
    print(f"slowest: {found.slowest[0]:.1f} s, {found.slowest[1][:100]}")
    print(f"{number} inputs, {len(found.faults)} faults")
    for fault in found.faults:
        print(fault)
    if options.accepted:
        options.accepted.write_text("\n".join(found.accepted) + "\n", encoding="utf-8")
    return 1 if found.faults else 0


if __name__ == "__main__":
    sys.exit(main())
