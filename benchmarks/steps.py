"""Time of one call: model functions, policy, learner step, plant step; compiled beside virtual machine.

    python benchmarks/steps.py

Medians over repeated batches in one process; compare the ratios, not the absolute times of a machine.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.online import Learner, draw_samples
from stationkeep.symbolic import Kernel, Model, ValueFunctions


def microseconds(call: Callable[[], object], calls: int, batches: int = 9) -> float:
    """Return the median time of one call [us]."""
    times = []
    for _ in range(batches):
        started = time.perf_counter()
        for _ in range(calls):
            call()
        times.append((time.perf_counter() - started) / calls)
    return 1e6 * statistics.median(times)


def functions() -> None:
    """Print compiled against virtual machine, and through buffers against CasADi's own call."""
    station = Scenario.load().station_keeping()
    zeta = 0.1 * np.ones(12)
    print(
        f"{'function':<16}{'compiled [us]':>15}{'virtual m. [us]':>17}{'ratio':>8}{'__call__ [us]':>15}"
    )
    kernels: dict[str, tuple[Kernel, Kernel]] = {}
    models = [Model(station.model.vehicle, compiled=c) for c in (True, False)]
    values = [ValueFunctions(station.problem, station.basis, compiled=c) for c in (True, False)]
    for name in ("plant", "drift_jacobian"):
        kernels[name] = (getattr(models[0], name), getattr(models[1], name))
    for name in ("sigma", "sigma_prime", "policies"):
        kernels[name] = (getattr(values[0], name), getattr(values[1], name))
    for name, (compiled, virtual) in kernels.items():
        compiled.inputs[0][...] = zeta
        virtual.inputs[0][...] = zeta
        fast, slow = microseconds(compiled.evaluate, 3000), microseconds(virtual.evaluate, 1000)
        arguments = [np.array(array) for array in compiled.inputs]
        call = microseconds(lambda f=compiled.function, a=arguments: f(*a), 200)  # type: ignore[misc]
        print(f"{name:<16}{fast:>15.2f}{slow:>17.2f}{slow / fast:>8.1f}{call:>15.1f}")


def learner() -> None:
    """Print the time of a learning step for both laws and two sizes."""
    print(f"\n{'learner step':<16}{'functions':>11}{'samples':>9}{'time [us]':>12}")
    for basis, number in (("quadratic", 300), ("drag", 2000)):
        scenario = Scenario.load(overrides=[f"basis.name={basis}", f"samples.number={number}"])
        station = scenario.station_keeping()
        for rule in ("gradient", "least_squares"):
            settings = scenario.learner.model_copy(update={"rule": rule})
            points = draw_samples(station.envelope, number, 1)
            weights = station.riccati_weights
            actor_critic = Learner(
                station.problem, station.basis, settings, points, weights, None, station.functions
            )
            zeta = scenario.initial_state
            taken = microseconds(lambda a=actor_critic, z=zeta: a.step(z, 0.25), 5, 5)  # type: ignore[misc]
            print(f"{rule:<16}{station.basis.n_basis:>11}{number:>9}{taken:>12.0f}")


if __name__ == "__main__":
    functions()
    learner()
