"""Many optima with their progress: how fast it goes, and the time that is left."""

from __future__ import annotations

import argparse
import time
from datetime import timedelta

from ..comparison.optima import Optima
from ..comparison.parallel import default_workers
from ..symbolic import InputError
from .output import Tell, progress


def n_workers(options: argparse.Namespace) -> int:
    """Return --workers, or the number of cores; raises InputError if it is not positive."""
    chosen: int | None = options.workers
    if chosen is not None and chosen < 1:
        raise InputError(f"--workers is {chosen}, but must be at least 1")
    return default_workers() if chosen is None else chosen


def solve(options: argparse.Namespace, optima: Optima, stage: str) -> dict[int, str]:
    """Solve with progress on stderr; return the states that were given up, and why."""
    with progress(options) as tell:
        tell(stage, 0.0)
        return optima.solve(n_workers(options), Rate(tell, stage, len(optima.states)))


class Rate:
    """Tells the rate and the time left of many solves."""

    def __init__(self, tell: Tell, stage: str, n: int) -> None:
        self.tell = tell
        self.stage = stage
        self.n = n
        self.started = time.monotonic()

    def __call__(self, done: int, solved: int) -> None:
        """Tell that `done` states are there, `solved` of them made in this run."""
        note = f"{done} of {self.n}"
        if solved:
            rate = solved / (time.monotonic() - self.started)
            left = timedelta(seconds=round((self.n - done) / rate))
            note += f", {rate:.2g}/s, {left} left"
        self.tell(self.stage, done / max(self.n, 1), note)
