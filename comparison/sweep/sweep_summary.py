"""What a sweep found: for each policy and each choice of settings, how its runs are distributed."""

from __future__ import annotations

import json
import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..merit import QUANTILES, Regret, below_optimum

FIGURES = ("regret", "position_rms", "energy", "policy_mean")
REFERENCE = "linear"
TOO_SHORT = 1e-3  # of the cost is an estimate of what is still to come


class _Group:
    def __init__(self) -> None:
        self.n = 0
        self.failed = 0
        self.too_short = 0
        self.with_optimum = 0
        self.figures = {name: array("d") for name in FIGURES}

    def add(self, row: Mapping[str, Any]) -> None:
        """Count a row; of one that failed there are no figures."""
        self.n += 1
        self.with_optimum += row.get("optimum") is not None
        self.failed += bool(row["failed"])
        self.too_short += not row["failed"] and (row["rest_share"] or 0.0) > TOO_SHORT
        for name, values in self.figures.items():
            if not row["failed"] and row[name] is not None:
                values.append(row[name])

    @property
    def regret(self) -> Regret:
        """Of the runs that have one, and of those that failed, where any has an optimum."""
        found = self.figures["regret"]
        return Regret.of([*found, *[None] * self.failed] if found or self.with_optimum else [])

    def told(self) -> dict[str, Any]:
        """Return numbers of runs and of failed ones, the regret's distribution and other medians."""
        medians = {
            name: float(np.median(values)) if values else None
            for name, values in self.figures.items()
            if name != "regret"
        }
        return {
            "n": self.n,
            "failed": self.failed,
            "too_short": self.too_short,
            "regret": self.regret.as_json(),
            **medians,
        }


def summary(rows: Iterable[Mapping[str, Any]], settings: Sequence[str]) -> list[dict[str, Any]]:
    """Return one entry for each policy and each choice of `settings`, in the order of the rows.

    Each has the policy and the settings, `n`, `failed` and `too_short`; the `regret` (`Regret.as_json`,
    runs that failed as infinite); of those that did not fail the medians of position_rms, energy and
    policy_mean; and where the linear policy takes part `of_linear`, the three regrets over its own,
    None where one of the two is infinite.
    """
    groups: dict[str, _Group] = {}
    for row in rows:
        name = json.dumps([[row[key] for key in settings], row["policy"]])
        groups.setdefault(name, _Group()).add(row)
    found = []
    for name, group in groups.items():
        values, policy = json.loads(name)
        reference = groups.get(json.dumps([values, REFERENCE]))
        of_linear = _ratio(group.regret, reference.regret) if reference else None
        head = {"policy": policy, "settings": dict(zip(settings, values, strict=True))}
        found.append(head | group.told() | {"of_linear": of_linear})
    return found


def faults(rows: Iterable[Mapping[str, Any]], most: int = 20) -> list[str]:
    """Return the runs whose regret no policy can have and those that learned nothing though it was due.

    The first `most` of them, and how many more there are.
    """
    found, more = list[str](), 0
    for row in rows:
        if row["failed"]:
            continue
        fault = below_optimum(row["regret"], row["regret_error"] or 0.0) or row["unlearned"]
        if fault and len(found) < most:
            found.append(f"run {row['run']}, {row['policy']}: {fault}")
        more += bool(fault)
    more -= len(found)
    return [*found, f"{more} more runs have faults of these kinds"] if more else found


def _ratio(one: Regret, other: Regret) -> dict[str, float | None]:
    pairs = {name: (getattr(one, name), getattr(other, name)) for name in QUANTILES}
    return {
        name: value / reference if math.isfinite(value) and 0.0 != reference < math.inf else None
        for name, (value, reference) in pairs.items()
    }
