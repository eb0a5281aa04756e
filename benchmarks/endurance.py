"""A controller over a long time: a million steps, and hours of learning; memory and weights, printed.

    python benchmarks/endurance.py [--seed N] [--steps N] [--hours H] [--rows N] [SCENARIO] [KEY=VALUE]

First a controller that does not learn is stepped with drawn measurements, of which every hundredth is
what no sensor should give: NaN, infinity, 1e300, a position 1 km away, 50 m/s, a wrong dt. Then a
vehicle is driven in closed loop, by a controller that learns, with a disturbance observer beside it.
A drawn force acts on it, a new one every 5 s; every 60 s it is put elsewhere in the envelope, or where
it got lost; now and then a measurement is NaN, or 2 s late. Printed over time: memory of the process
(resident, and the peak), the largest weight of critic and actors, the largest eigenvalue of the
covariance, the estimate, the largest wrench, and what was flagged and refused. It ends with exit code 1
if anything was not finite, or the memory of the last half of the rows grew by more than 2 MB.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import logging
import resource
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.online import Controller, DisturbanceObserver, draw_samples
from stationkeep.online.loop import PlantState
from stationkeep.online.vehicle import DisturbanceSettings, HeldPlant, build_disturbance
from stationkeep.symbolic import InputError, RunError
from stationkeep.symbolic.arrays import Array

PERIOD = 0.02  # s
FORCE = np.array([4.0, 4.0, 4.0, 0.3, 0.3, 0.5])  # deviation of the drawn force [N, N m]
NO_MEASUREMENT = (np.nan, np.inf, -np.inf, 1e300, 1e3, 50.0)
GROWTH = 2.0  # MB


@dataclass
class Row:
    """What is printed of a moment.

    Attributes
    ----------
    time : number of steps, or simulated time [s]
    memory, peak : resident memory of the process now and at most [MB]
    weight : largest magnitude among the weights of critic and actors
    covariance : largest eigenvalue of the critic's covariance
    estimate, wrench : largest magnitude since the last row [N, N m]
    flags : how many steps had each flag so far; `refused` and `lost` too
    """

    time: float
    memory: float
    peak: float
    weight: float
    covariance: float
    estimate: float
    wrench: float
    flags: Counter[str] = field(default_factory=Counter)

    @property
    def finite(self) -> bool:
        """Whether all of it is."""
        return bool(np.isfinite([self.weight, self.covariance, self.estimate, self.wrench]).all())

    def __str__(self) -> str:
        flags = ", ".join(f"{name} {n}" for name, n in sorted(self.flags.items()))
        return (
            f"{self.time:>10.0f}{self.memory:>10.1f}{self.peak:>10.1f}{self.weight:>12.4g}"
            f"{self.covariance:>12.3g}{self.estimate:>10.3g}{self.wrench:>10.3g}  {flags}"
        )


HEADER = (
    f"{'':>10}{'now [MB]':>10}{'peak [MB]':>10}{'weight':>12}{'covariance':>12}{'d_hat':>10}"
    f"{'wrench':>10}  flags"
)


def stepped(scenario: Scenario, steps: int, seed: int, rows: int) -> Iterator[Row]:
    """Step a controller that does not learn with drawn measurements, and yield rows."""
    controller, rng = Controller(scenario, learn=False), np.random.default_rng(seed)
    refused, largest = 0, 0.0
    for i in range(1, steps + 1):
        eta = np.array([0.5, 0.5, 0.5, 0.1, 0.1, 0.2]) * rng.standard_normal(6)
        eta_dot, dt = 0.1 * rng.standard_normal(6), PERIOD * float(rng.uniform(0.5, 2.0))
        if i % 100 == 0:
            (eta, eta_dot)[int(rng.integers(2))][rng.integers(6)] = rng.choice(NO_MEASUREMENT)
            dt = float(rng.choice([dt, 0.0, -1.0, np.nan, 2.0, 1e12]))
        try:
            largest = max(largest, _size(controller.step(eta, eta_dot, dt)))
        except InputError:
            refused += 1
        if i % (steps // rows) == 0:
            yield _row(i, controller, 0.0, largest, Counter({"refused": refused}))
            largest = 0.0


def learned(scenario: Scenario, duration: float, seed: int, rows: int) -> Iterator[Row]:
    """Drive a vehicle for so long [s] with a controller that learns, and yield rows."""
    controller, rng = Controller(scenario), np.random.default_rng(seed)
    station, limits = controller.setup, controller.limits
    observer = DisturbanceObserver(station, 0.5)
    plant = HeldPlant(station, build_disturbance(DisturbanceSettings()))
    starts = draw_samples(station.envelope, 1000, seed)
    state, tau_d, tau_b, counts = (
        PlantState(starts[0], 0.0, 0.0),
        np.zeros(6),
        np.zeros(6),
        Counter[str](),
    )
    largest, estimate = 0.0, np.zeros(6)
    n_steps = round(duration / PERIOD)
    for i in range(1, n_steps + 1):
        if i % 250 == 0:
            tau_d = FORCE * rng.standard_normal(6)
        far = np.abs(state.zeta / station.half_widths).max() > limits.far
        lost = far or abs(state.zeta[4]) > np.radians(limits.pitch - 5.0)
        if i % 3000 == 0 or lost:
            counts["lost"] += int(lost)
            state = replace(state, zeta=starts[i % len(starts)])
        seen, dt = state.zeta.copy(), PERIOD
        if rng.random() < 1e-3:
            seen[rng.integers(12)] = np.nan
        if rng.random() < 1e-3:
            dt = 2.0
        try:
            tau_b = controller.step(seen[:6], seen[6:], dt)
            estimate = observer.step(seen, dt)
            tau_b = tau_b - controller.body_wrench(estimate)
            observer.applied(tau_b)
        except InputError:
            counts["refused"] += 1
        largest = max(largest, _size(tau_b))
        try:
            state = plant.advance(0.0, state, tau_b, tau_d, PERIOD)
        except RunError:
            counts["lost"] += 1
            state = replace(state, zeta=starts[i % len(starts)])
        if i % (n_steps // rows) == 0:
            yield _row(i * PERIOD, controller, _size(estimate), largest, counts)
            largest = 0.0


def _size(values: Array) -> float:
    """Return the largest magnitude; NaN if one is."""
    return float(np.abs(values).max())


def _row(
    time: float, controller: Controller, estimate: float, wrench: float, counts: Counter[str]
) -> Row:
    learner = controller.learner
    weights = np.concatenate([learner.critic, learner.actor_1, learner.actor_2])
    covariance = float(getattr(learner.law, "covariance_norm", 0.0))
    flags = controller.counts + counts
    return Row(time, memory(), peak(), _size(weights), covariance, estimate, wrench, flags)


def memory() -> float:
    """Return the resident memory of this process [MB], the peak where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return peak()
    return pages * resource.getpagesize() / 1e6


def peak() -> float:
    """Return the largest resident memory that this process has had [MB]."""
    unit = 1.0 if sys.platform == "darwin" else 1024.0  # bytes there, KiB elsewhere
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def growth(rows: list[Row]) -> float:
    """Return how much more memory the last row has than the one in the middle [MB]."""
    return rows[-1].memory - rows[len(rows) // 2].memory


def printed(title: str, rows: Iterator[Row]) -> bool:
    """Print rows as they come; return whether all is finite and the memory flat."""
    print(f"\n{title}\n{HEADER}", flush=True)
    kept = []
    for row in rows:
        print(row, flush=True)
        kept.append(row)
    finite, grown = all(row.finite for row in kept), growth(kept)
    print(f"memory of the second half: {grown:+.2f} MB; {'all' if finite else 'not all'} finite")
    return finite and grown <= GROWTH


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description="a controller over a long time")
    parser.add_argument("scenario", nargs="?", default="bluerov2-heavy")
    parser.add_argument("overrides", nargs="*", help="settings, as KEY=VALUE")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--hours", type=float, default=3.0, help="simulated, of learning")
    parser.add_argument("--rows", type=int, default=20)
    options = parser.parse_args()
    logging.getLogger("stationkeep").setLevel(logging.ERROR)  # each flag that begins is a warning
    scenario = Scenario.load(options.scenario, options.overrides)
    steps = stepped(scenario, options.steps, options.seed, options.rows)
    hours = learned(scenario, 3600.0 * options.hours, options.seed, options.rows)
    fine = printed(f"{options.steps} steps without learning", steps)
    return 0 if printed(f"{options.hours:g} h of learning [s]", hours) and fine else 1


if __name__ == "__main__":
    raise SystemExit(main())
