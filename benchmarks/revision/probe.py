"""What is timed in one process of a revision's own environment: prints one JSON object.

    python probe.py import MODULE | step | loop | offline

Only public names of the package are used, so that it fits every layout of its modules. Nothing heavy is
imported before the clock runs.
"""

from __future__ import annotations

import importlib
import json
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

FIXED = (
    *("learner.error=bellman", "learner.safeguard=false", "learner.normalizer=paper"),
    *("learner.leash=0", "learner.period=0.05"),
    *("basis.name=quadratic", "samples.number=300"),
)
# settings, and how many calls a batch has
STEPS: dict[str, tuple[tuple[str, ...], int]] = {
    "shipped": ((), 10),
    "least squares, 300 samples": ((*FIXED, "learner.rule=least_squares"), 200),
    "gradient law, 300 samples": ((*FIXED, "learner.rule=gradient"), 400),
}
BATCHES = 9


class MissingError(Exception):
    """The revision lacks a public name."""


def public(folder: str, name: str) -> Any:
    """Return a public name of a folder, or of the package."""
    for module in (f"stationkeep.{folder}", "stationkeep"):
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError):
            continue
    raise MissingError(f"neither stationkeep.{folder} nor stationkeep has a name '{name}'")


def clocked(name: str, call: Callable[[], object], calls: int = 1) -> dict[str, float]:
    """Return processor and wall time of a call [s]."""
    worked, started = time.process_time(), time.perf_counter()
    for _ in range(calls):
        call()
    processor, wall = time.process_time() - worked, time.perf_counter() - started
    return {f"{name}, processor": processor / calls, f"{name}, wall": wall / calls}


def importing(name: str) -> dict[str, float]:
    """Time an import."""
    modules: list[Any] = []
    times = clocked("import", lambda: modules.append(importlib.import_module(name)))
    if getattr(modules[0], "__file__", None) is None:
        raise MissingError(f"'{name}' is a namespace without a module of its own")
    return times


def step() -> dict[str, float]:
    """Time calls of a controller that learns at each of them, at a fixed state, in batches."""
    scenario_class, controller_class = public("comparison", "Scenario"), public("online", "Controller")
    times: dict[str, float] = {}
    for name, (overrides, calls) in STEPS.items():
        scenario = scenario_class.load(overrides=list(overrides))
        controller = controller_class(scenario)
        zeta, period = scenario.initial_state, scenario.learner.period or 0.25

        def call(controller: Any = controller, zeta: Any = zeta, period: float = period) -> object:
            return controller.step(zeta[:6], zeta[6:], period)

        clocked(name, call, calls)  # warms up
        batches = [clocked(name, call, calls) for _ in range(BATCHES)]
        times |= {clock: statistics.median(batch[clock] for batch in batches) for clock in batches[0]}
    return times


def loop() -> dict[str, float]:
    """Time 10 s of the shipped scenario in closed loop."""
    scenario = public("comparison", "Scenario").load(overrides=["simulation.duration=10"])
    run = public("online", "run")
    scenario.station_keeping()
    return clocked("10 s simulated", lambda: run(scenario))


def offline() -> dict[str, float]:
    """Time the certified optimum of the shipped problem from the scenario's state, twice."""
    scenario = public("comparison", "Scenario").load()
    solver_class = public("offline", "OfflineSolver")
    problem, zeta = scenario.station_keeping().problem, scenario.initial_state
    solvers: list[Any] = []

    def first() -> object:
        solvers.append(solver_class(problem, scenario.offline))
        return solvers[0].solve(zeta)

    times = clocked("built and solved", first)
    return times | clocked("solved again", lambda: solvers[0].solve(zeta))


def main(what: str, *names: str) -> None:
    """Print the times of what is asked for, or what is lacking."""
    asked = {"import": importing, "step": step, "loop": loop, "offline": offline}
    try:
        print(json.dumps(asked[what](*names)))  # type: ignore[operator]
    except MissingError as missing:
        print(json.dumps({"lacks": str(missing)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
