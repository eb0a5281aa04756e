"""Certified optima from many states: planned from the states alone, solved in parallel, each kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ...offline import Certificate, OfflineSolver, Plant
from ...online import load, save
from ...online.records import read_parts, remove_temporaries
from ...symbolic.arrays import Array
from ..parallel import Work, run_tasks
from ..records import kept_key, optimum_or_failure, optimum_provenance, trajectory_of
from ..scenario import Scenario
from .plan import Step, plan

CERTIFICATE = tuple(field.name for field in fields(Certificate))
VERDICTS = tuple(field.name for field in fields(Certificate) if field.type == "bool")
Chunk = list[tuple[Step, Array]]
Progress = Callable[[int, int], None]


def unit_text(units: Sequence[str]) -> str:
    """Return the units of states or inputs as an attribute has them, each once: "m, rad"."""
    return ", ".join(dict.fromkeys(units))


def record_path(folder: Path, state: int) -> Path:
    """Return where the optimum from a row of the states is kept."""
    return folder / f"optimal-{state + 1}.nc"


@dataclass(frozen=True)
class Optima:
    """The optima from the rows of `states`, of a scenario, as records in a folder.

    Attributes
    ----------
    scenario : the game
    states : (N, n)
    folder : of the records, one a state
    """

    scenario: Scenario
    states: Array
    folder: Path

    def solve(self, n_workers: int, progress: Progress) -> dict[int, str]:
        """Make the records that are not there yet; return the states that were given up, and why.

        What a record holds follows from scenario and states: a run that was killed at any moment
        and started again, with however many workers, ends with the same records.

        Parameters
        ----------
        progress : called with the number of states that are done and of those solved in this run
        """
        remove_temporaries(self.folder, "optimal-*.nc")
        try:
            return self._solve(n_workers, progress)
        finally:
            remove_temporaries(self.folder, "optimal-*.nc")

    def _solve(self, n_workers: int, progress: Progress) -> dict[int, str]:
        half_widths = self.scenario.setup().half_widths
        chunks = plan(self.states, half_widths)
        tasks: list[Chunk] = [[(step, self.states[step.state]) for step in chunk] for chunk in chunks]
        done, solved = np.zeros(len(self.states), dtype=bool), 0
        given_up: dict[int, str] = {}
        shipment = (self.scenario, self.folder)
        with closing(run_tasks(_worker, shipment, tasks, n_workers)) as events:
            for event in events:
                if event.message is not None:
                    state, fresh = event.message
                    solved += int(fresh and not done[state])
                    done[state] = True
                    progress(int(done.sum()), solved)
                else:
                    rest = [step.state for step in chunks[event.task] if not done[step.state]]
                    given_up |= dict.fromkeys(rest, str(event.failure))
        return given_up

    def rows(self, given_up: dict[int, str]) -> Iterator[dict[str, Any]]:
        """Yield what is told of each state, in their order, read from the records one by one."""
        problem = self.scenario.setup().problem
        plant = Plant(problem)
        for state, zeta in enumerate(self.states):
            if state in given_up:
                yield _failure(zeta, given_up[state], None)
                continue
            path = record_path(self.folder, state)
            attributes, _ = read_parts(path)
            seconds = float(attributes["certified_seconds"])
            if "failed" in attributes:
                yield _failure(zeta, str(attributes["failed"]), seconds)
                continue
            costate = read_parts(path, "costate")[1]["costate"]
            u_control, u_disturbance = problem.game.policies(plant.terms(zeta)[1], costate)
            yield {
                "zeta": zeta,
                "value": float(attributes["value"]),
                "costate": costate,
                "u_control": u_control,
                "u_disturbance": u_disturbance,
                "certificate": {name: _entry(name, attributes[name]) for name in CERTIFICATE},
                "extremals": json.loads(str(attributes["extremals"])),
                "turns": _turns(str(attributes.get("turns", "[]")), problem.state_names),
                "iterations": int(attributes["iterations"]),
                "seconds": float(attributes["seconds"]),
                "certified_seconds": seconds,
                "faults": [fault for fault in str(attributes["faults"]).split("; ") if fault],
            }


def _entry(name: str, value: Any) -> float | bool:
    return bool(value) if name in VERDICTS else float(value)


def _turns(text: str, names: Sequence[str]) -> dict[str, int]:
    """Return the states of the optimum that are whole periods off the short way, and by how many."""
    return {name: n for name, n in zip(names, json.loads(text), strict=False) if n}


def _failure(zeta: Array, reason: str, seconds: float | None) -> dict[str, Any]:
    unknown = ("value", "costate", "u_control", "u_disturbance", "iterations", "seconds")
    return {
        "zeta": zeta,
        **dict.fromkeys(unknown),
        "certificate": dict.fromkeys(CERTIFICATE),
        "extremals": [],
        "turns": {},
        "certified_seconds": seconds,
        "faults": [reason],
    }


def _worker(shipment: tuple[Scenario, Path]) -> Work[Chunk, tuple[int, bool]]:
    """Build the solver once; return what solves a chunk, telling each state and whether it was new."""
    scenario, folder = shipment
    solver = OfflineSolver(scenario.setup().problem, scenario.offline)

    def work(chunk: Chunk) -> Iterator[tuple[int, bool]]:
        before = {step.state: step.after for step, _ in chunk}
        for step, zeta in chunk:
            path, (guess, guess_key) = record_path(folder, step.state), _start(folder, step, before)
            attributes = optimum_provenance(scenario, zeta, guess_key)
            fresh = kept_key(path) != attributes["key"]
            if fresh:
                trajectory = None if guess is None else trajectory_of(load(guess))
                save(optimum_or_failure(scenario, solver, zeta, attributes, trajectory), path)
            yield step.state, fresh

    return work


def _start(folder: Path, step: Step, before: dict[int, int | None]) -> tuple[Path | None, str]:
    """Return the record that a step starts from, the first before it with a trajectory, and its key."""
    state = step.after
    while state is not None:
        path = record_path(folder, state)
        attributes, _ = read_parts(path)
        if "failed" not in attributes:
            return path, str(attributes["key"])
        state = before[state]
    return None, ""
