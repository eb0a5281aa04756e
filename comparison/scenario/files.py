"""The contents of the files that a scenario names, so that its record can be run without them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...symbolic import Problem, Vehicle
from ...symbolic.arrays import Array
from ...symbolic.pyfile import is_named
from ...symbolic.toml import locate, read_toml
from ...symbolic.value import BasisFunction


def read_settings(name: str | Path) -> tuple[dict[str, Any], Path | None]:
    """Return the settings of a scenario's file and its folder; a problem's name is its only setting."""
    if isinstance(name, str) and is_named(name):
        return {"problem": name}, None
    path = locate(name, str(__package__), "scenarios", "scenario")
    return read_toml(path), path.parent


@dataclass(frozen=True)
class Files:
    """What is taken instead of reading files.

    Attributes
    ----------
    vehicles : of `vehicle` and `simulation.plant`, by name
    problems : of `problem`, by name
    bases : of `basis.name`, functions of the scaled state, by name
    weights : (m,) that the learner starts from; None where no file says
    """

    vehicles: Mapping[str, Vehicle] = field(default_factory=dict)
    problems: Mapping[str, Problem] = field(default_factory=dict)
    bases: Mapping[str, BasisFunction] = field(default_factory=dict)
    weights: Array | None = None

    def without(self, groups: Collection[str]) -> Files:
        """Return what still holds when these groups of settings change."""
        return replace(self, weights=None) if "learner" in groups else self
