"""Regret of a run, and how it is distributed over many; a run that failed counts as infinite."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

QUANTILES = {"median": 0.5, "p90": 0.9, "max": 1.0}


def regret(cost: float | None, optimum: float | None) -> float | None:
    """Return (cost - V*) / V*.

    Parameters
    ----------
    cost : of the run; infinite if it ended early, None if it is not known
    optimum : V* > 0, or in `disturbed` mode the clairvoyant optimum; None if it is not known

    Returns
    -------
    None where one of the two is not known, or where V* is zero: from the station itself there is
    nothing to be gained.
    """
    if cost is None or not optimum:
        return None
    return (cost - optimum) / optimum


def below_optimum(regret: float | None, error: float) -> str | None:
    """Return the fault of a regret that no policy can have; None if it is possible, or not known.

    Parameters
    ----------
    error : relative, of the optimum and of the run's cost together
    """
    if regret is None or not regret < -error:
        return None
    return (
        f"its regret is {regret:.1e}, below zero by more than the error {error:.0e} of optimum and "
        "cost: one of the two is wrong"
    )


@dataclass(frozen=True)
class Regret:
    """How the regret of n runs is distributed.

    A run that ended early, or whose V* was not found, counts as infinite, so that it is in every
    quantile. The quantile q of n regrets in ascending order is that of number ceil(q (n - 1)), counted
    from zero: the regret of one of the runs, never a value between two of them; of the two between
    which q falls it is the larger one. So the median of an even number is the upper of the middle two.

    Attributes
    ----------
    n : number of runs
    diverged : how many of them count as infinite
    median, p90, max : quantiles 0.5, 0.9 and 1; infinite where they fall on such a run, or if n is 0
    """

    n: int
    diverged: int
    median: float
    p90: float
    max: float

    @classmethod
    def of(cls, regrets: Iterable[float | None]) -> Regret:
        """Return the distribution of regrets; None, infinity and NaN are runs that failed."""
        found = np.array(
            [math.inf if one is None or math.isnan(one) else one for one in regrets], dtype=float
        )
        if not len(found):
            return cls(0, 0, math.inf, math.inf, math.inf)
        quantiles = np.quantile(found, [*QUANTILES.values()], method="higher").tolist()
        return cls(len(found), int(np.sum(~np.isfinite(found))), *quantiles)

    @property
    def note(self) -> str | None:
        """Why a quantile is infinite, in one sentence; None if all are finite."""
        if math.isfinite(self.max):
            return None
        if self.n == 0:
            return "there is no run with an optimum to compare with"
        runs = f"{self.diverged} of {self.n} runs" if self.n > 1 else "the run"
        return f"null stands for infinity: {runs} ended early or had no optimum to compare with"

    def as_json(self) -> dict[str, Any]:
        """Return median, p90, max, diverged and n; an infinite quantile is None, with a `note`."""
        quantiles = {name: finite(getattr(self, name)) for name in QUANTILES}
        found = quantiles | {"diverged": self.diverged, "n": self.n}
        return found if self.note is None else found | {"note": self.note}


def finite(value: float) -> float | None:
    """Return the value, None if it is infinite or not a number."""
    return value if math.isfinite(value) else None
