"""Times of two revisions, in processes that take turns, as ratios pair by pair."""

from __future__ import annotations

import json
import math
import resource
import statistics
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .environment import Revision

PROBE = Path(__file__).with_name("probe.py")
# what is asked of `probe.py`; None is the command itself
PROBES: dict[str, tuple[str, ...] | None] = {
    "import stationkeep.symbolic": ("import", "stationkeep.symbolic"),
    "import stationkeep": ("import", "stationkeep"),
    "stationkeep --help": None,
    "learner step": ("step",),
    "closed loop": ("loop",),
    "offline": ("offline",),
}
PROCESS = "whole process, user + system"


class LacksError(Exception):
    """A revision has not what is to be timed; one sentence says why."""


@dataclass(frozen=True)
class Ratio:
    """Times of one thing, in seconds, and of the pairs' ratios NEW / OLD the median and an interval.

    Times are medians, NaN where the revision has none; so are ratios without pairs.
    """

    old: float
    new: float
    median: float
    low: float
    high: float


def measure(revision: Revision, words: tuple[str, ...] | None) -> dict[str, float]:
    """Return the processor time of one process, and what the probe says that it measured [s].

    Raises
    ------
    LacksError
        If the revision lacks what is asked for.
    """
    line = [str(revision.command), "--help"]
    if words is not None:
        line = [str(revision.python), str(PROBE), *words]
    before = _children()
    done = subprocess.run(
        line, cwd=revision.folder, env=revision.variables, capture_output=True, text=True, check=False
    )
    process = {PROCESS: _children() - before}
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no message"]
        raise LacksError(lines[-1])
    answer = {} if words is None else json.loads(done.stdout)
    if "lacks" in answer:
        raise LacksError(str(answer["lacks"]))
    return {**answer, **process}


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def time_all(both: Sequence[Revision], pairs: int) -> tuple[dict[tuple[str, str], Ratio], list[str]]:
    """Return ratios by probe and clock, and a sentence for each thing that a revision lacks."""
    ratios: dict[tuple[str, str], Ratio] = {}
    sentences = []
    for name, words in PROBES.items():
        print(f"times: {name} ...", file=sys.stderr, flush=True)
        able = []
        for revision in both:
            try:
                measure(revision, words)  # fills caches
                able.append(revision)
            except LacksError as lack:
                sentences.append(f"{revision.label}: no time of '{name}': {lack}")
        turns = [{r.label: measure(r, words) for r in able} for _ in range(pairs if able else 0)]
        clocks = dict.fromkeys(clock for turn in turns for times in turn.values() for clock in times)
        for clock in clocks:
            old, new = ([turn.get(r.label, {}).get(clock, math.nan) for turn in turns] for r in both)
            ratios[name, clock] = paired(old, new)
    return ratios, sentences


def paired(old: Sequence[float], new: Sequence[float]) -> Ratio:
    """Return medians of times, and the ratios of those that have a partner."""
    ratios = [b / a for a, b in zip(old, new, strict=True) if not math.isnan(b / a)]
    middle = statistics.median(ratios) if ratios else math.nan
    return Ratio(statistics.median(old), statistics.median(new), middle, *interval(ratios))


def interval(values: Sequence[float], level: float = 0.95) -> tuple[float, float]:
    """Return an interval for the median of what the values are drawn from, whatever its distribution.

    The k-th smallest and the k-th largest value enclose it with the probability 1 - 2 P(B < k), B
    binomial (n, 1/2); k is the largest with at least `level`. NaN where there is none (n < 6 at 95 %).
    """
    n, k = len(values), 0
    while 1.0 - 2.0 * sum(math.comb(n, i) for i in range(k + 1)) / 2.0**n >= level:
        k += 1
    ordered = sorted(values)
    return (ordered[k - 1], ordered[n - k]) if k else (math.nan, math.nan)
