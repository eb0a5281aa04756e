"""One contender in a process of its own, asked over pipes; whatever happens there is a reason here."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from stationkeep.symbolic import Problem
from stationkeep.symbolic.arrays import Array

from .game import Mesh, Solve


@dataclass(frozen=True)
class Contender:
    """A way to solve the problem again from a new initial state.

    Attributes
    ----------
    name : the row's title
    build : "module:function" in this folder; (problem, mesh) -> solve, and solve(ζ_0) -> V
    mesh : the cheapest found that reaches the accuracy asked for
    python : which interpreter runs it: "own", or the name of a virtual environment
    packages : distributions whose versions are reported
    """

    name: str
    build: str
    mesh: Mesh
    python: str = "own"
    packages: tuple[str, ...] = ("casadi",)


def serve(contender: Contender, problem: Problem, warm_up: Array) -> None:
    """Build the contender, solve once, then answer each line of states with times and values."""
    # solvers print where they like; the answers keep the real standard output
    channel = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(**data: Any) -> None:
        print(json.dumps(data), file=channel, flush=True)

    try:
        module, _, function = contender.build.partition(":")
        build = getattr(importlib.import_module(f"peers.{module}"), function)
        started = time.perf_counter()
        solve: Solve = build(problem, contender.mesh)
        solve(warm_up)
        seconds = time.perf_counter() - started
        versions = {name: version(name) for name in contender.packages}
    except Exception as error:
        answer(reason=_one_line(error))
        return
    answer(build_seconds=seconds, versions=versions)
    for line in sys.stdin:
        answer(**_timed(solve, np.array(json.loads(line))))


def _timed(solve: Solve, states: Array) -> dict[str, Any]:
    seconds: list[float] = []
    values: list[float | None] = []
    reason = None
    for zeta0 in states:
        started = time.perf_counter()
        try:
            values.append(solve(zeta0))
        except Exception as error:
            values.append(None)
            reason = reason or _one_line(error)
        seconds.append(time.perf_counter() - started)
    return {"seconds": seconds, "values": values, "reason": reason}


def _one_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[-1]}"[:160] if lines else type(error).__name__


class Worker:
    """A contender's process, and what it said.

    Attributes
    ----------
    reason : why it has no results, or not for every state; None if it has
    build_seconds : to build it and to solve once
    rounds : of each round, the time of every state [s]
    values : of every state in the last round; None where it failed
    """

    def __init__(self, contender: Contender, command: list[str], limit: float) -> None:
        self.contender = contender
        self.reason: str | None = None
        self.build_seconds: float | None = None
        self.versions: dict[str, str] = {}
        self.rounds: list[list[float]] = []
        self.values: list[float | None] = []
        self._limit = limit
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - until `close`
        self._process: subprocess.Popen[str] | None = None
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                text=True,
                env=os.environ | {"OMP_NUM_THREADS": "1"},
            )
        except OSError as error:
            self.reason = f"{command[0]} does not start: {error.strerror}"
            return
        reply = self._reply()
        self.build_seconds = reply.get("build_seconds")
        self.versions = reply.get("versions", {})

    @property
    def seconds(self) -> float:
        """Time of all rounds [s]."""
        return float(np.sum(self.rounds))

    def run(self, states: Array) -> None:
        """Solve from every state once."""
        if self._process is None or self._process.poll() is not None or self.build_seconds is None:
            return
        assert self._process.stdin is not None
        print(json.dumps(states.tolist()), file=self._process.stdin, flush=True)
        reply = self._reply()
        if "seconds" in reply:
            self.rounds.append(reply["seconds"])
            self.values = reply["values"]

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._errors.close()

    def _reply(self) -> dict[str, Any]:
        """Wait for one answer; without one the process is at its end, and `reason` says how."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        timer = threading.Timer(self._limit, process.kill)
        timer.start()
        line = process.stdout.readline()
        late = not timer.is_alive()
        timer.cancel()
        if not line:
            process.kill()
            process.wait()
            self._errors.seek(0)
            said = self._errors.read().strip().splitlines()
            ending = said[-1][:160] if said else f"exit code {process.returncode}"
            self.reason = f"no answer in {self._limit:.0f} s" if late else f"ended: {ending}"
            return {}
        reply: dict[str, Any] = json.loads(line)
        self.reason = reply.get("reason") or self.reason
        return reply
