"""Where a record comes from: what its numbers depend on, and the key of all of it."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...online.records import versions
from ...symbolic import Setup, StationKeeping
from ...symbolic.game import problem_to_data
from ...symbolic.pyfile import file_content, is_named
from ..scenario import Scenario
from .store import key_of

FORMAT = 9  # of the records; raise it when what is in them, or how a run is made, changes
OFFLINE_KEY = {"vehicle", "problem", "current", "game", "envelope", "offline"}


def programs(scenario: Scenario, kind: str) -> list[str]:
    """Return what is in the user's Python files of a learner's law and of a policy, hexadecimal."""
    return [*scenario.law_content(), *([file_content(kind)] if is_named(kind) else [])]


def provenance(
    scenario: Scenario,
    kind: str,
    include: set[str] | Mapping[str, Any] | None = None,
    own: list[str] | None = None,
) -> dict[str, Any]:
    """Return the attributes that say where a record comes from.

    `program` is the hash of the `own` files of law and policy, which are no part of the record;
    `programs` if None.

    `key` is the hash of what the numbers depend on: the settings (those named in `include`, or all),
    the vehicle's parameters, the compiled functions and the versions.
    """
    setup = scenario.setup()
    plant_data = model_text(setup)
    text = scenario.model_dump_json(include=include)
    learned = include is None or "basis" in include
    functions = setup.fingerprint if learned else setup.plant_fingerprint
    parts = [str(FORMAT), kind, text, plant_data, functions]
    parts.append(repr(sorted(versions().items())))
    start = scenario.initial_weights() if include is None else None
    parts.append("" if start is None else start.tobytes().hex())
    used = (programs(scenario, kind) if own is None else own) if include is None else []
    parts += used
    simulated = include is None or "simulation" in include
    driven = scenario.plant_vehicle() if simulated else None
    plant = "" if driven is None else driven.model_dump_json()
    parts.append(plant)
    key = key_of(*parts)
    return {
        "kind": kind,
        "scenario": scenario.model_dump_json(),
        "vehicle" if scenario.problem is None else "problem": plant_data,
        "plant": plant,
        "mode": scenario.simulation.mode,
        "seed": scenario.samples.seed,
        "functions": functions,
        "program": key_of(*used) if used else "",
        "format": FORMAT,
        "machine": machine(),
        "key": key,
    }


def model_text(setup: Setup) -> str:
    """Return what policies are made for, as JSON: a vehicle's parameters, or a problem's equations."""
    if isinstance(setup, StationKeeping):
        return setup.model.vehicle.model_dump_json()
    return json.dumps(problem_to_data(setup.problem))


def machine() -> str:
    """Return the kind of machine and the widest vector instructions that numpy found on it."""
    found = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    return " ".join([platform.system(), platform.machine(), *found[-1:]])
