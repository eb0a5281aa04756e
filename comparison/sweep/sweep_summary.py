"""What a sweep found: for each policy and each choice of settings, how its runs are distributed."""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..merit import distribution

FIGURES = ("regret", "position_rms", "energy", "policy_mean")
REFERENCE = "linear"
TOO_SHORT = 1e-3  # of the cost is an estimate of what is still to come


class _Group:
    def __init__(self) -> None:
        self.n = 0
        self.failed = 0
        self.too_short = 0
        self.figures = {name: array("d") for name in FIGURES}

    def add(self, row: Mapping[str, Any]) -> None:
        """Count a row; of one that failed there are no figures."""
        self.n += 1
        self.failed += bool(row["failed"])
        self.too_short += not row["failed"] and (row["rest_share"] or 0.0) > TOO_SHORT
        for name, values in self.figures.items():
            if not row["failed"] and row[name] is not None:
                values.append(row[name])

    def told(self) -> dict[str, Any]:
        """Return numbers of runs and of failed ones, the regret's distribution and other medians."""
        regret = distribution([*self.figures["regret"]])
        medians = {
            name: float(np.median(values)) if values else None
            for name, values in self.figures.items()
            if name != "regret"
        }
        shown = {name: regret[name] for name in ("median", "p90", "max")}
        return {
            "n": self.n,
            "failed": self.failed,
            "too_short": self.too_short,
            "regret": shown,
            **medians,
        }


def summary(rows: Iterable[Mapping[str, Any]], settings: Sequence[str]) -> list[dict[str, Any]]:
    """Return one entry for each policy and each choice of `settings`, in the order of the rows.

    Each has the policy and the settings, `n`, `failed` and `too_short`; of the runs that did not fail
    the `regret` (median, p90, max) and the medians of position_rms, energy and policy_mean; and where
    the linear policy takes part `of_linear`, the three regrets over its own.
    """
    groups: dict[str, _Group] = {}
    for row in rows:
        name = json.dumps([[row[key] for key in settings], row["policy"]])
        groups.setdefault(name, _Group()).add(row)
    told = {name: group.told() for name, group in groups.items()}
    found = []
    for name, entry in told.items():
        values, policy = json.loads(name)
        reference = told.get(json.dumps([values, REFERENCE]))
        of_linear = _ratio(entry["regret"], reference["regret"]) if reference else None
        head = {"policy": policy, "settings": dict(zip(settings, values, strict=True))}
        found.append(head | entry | {"of_linear": of_linear})
    return found


def _ratio(one: dict[str, float | None], other: dict[str, float | None]) -> dict[str, float | None]:
    return {
        name: None if value is None or not other[name] else value / float(other[name] or 1.0)
        for name, value in one.items()
    }
