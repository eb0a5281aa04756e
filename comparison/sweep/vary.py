"""A scenario with some settings or vehicle parameters changed, and which settings are to be changed.

Besides the keys of a scenario there are `vehicle.KEY`, a parameter of the vehicle that the policies are
made for (and that is driven, unless the scenario names another one), and `plant.KEY`, one of the
driven vehicle only. `vehicle.KEY.factor` multiplies it, all entries of an array alike.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...symbolic import InputError, Vehicle
from ..scenario import Scenario, parse_values, replace_value, value_at

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_RANGE = re.compile(rf"\s*({_NUMBER})\s*:\s*({_NUMBER})\s*(?::\s*(log)\s*)?")
_PARAMETER = re.compile(r"(vehicle|plant)\.(.+)")
_FACTOR = ".factor"


@dataclass(frozen=True)
class Choices:
    """A setting that takes each of some values."""

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Range:
    """A setting that is sampled between two numbers.

    Attributes
    ----------
    low, high : low < high
    log : whether its logarithm is uniform
    integer : whether the setting counts something
    """

    key: str
    low: float
    high: float
    log: bool = False
    integer: bool = False

    def at(self, unit: float) -> float | int:
        """Return the value at a number of [0, 1)."""
        if self.integer:
            return min(int(self.low + unit * (self.high - self.low + 1.0)), int(self.high))
        if self.log:
            return float(self.low * (self.high / self.low) ** unit)
        return self.low + unit * (self.high - self.low)


def parse_vary(texts: Sequence[str], scenario: Scenario) -> tuple[Choices | Range, ...]:
    """Return what "key=v1,v2", "key=low:high" or "key=low:high:log" ask for.

    Every value, and both ends of a range, must be one of the scenario, by itself or with the first
    values of the others.

    Raises
    ------
    InputError
        If there is no such key, or a value breaks a rule.
    """
    found = tuple(_parsed(text, scenario) for text in texts)
    first = {one.key: _ends(one)[0] for one in found}
    for one, text in zip(found, texts, strict=True):
        for value in _ends(one):
            try:
                _try(scenario, {one.key: value}, one.key, f"--vary {text}")
            except InputError:
                if not _is_possible(scenario, first | {one.key: value}, one.key):
                    raise
    return found


def _ends(one: Choices | Range) -> tuple[Any, ...]:
    return one.values if isinstance(one, Choices) else (one.at(0.0), one.at(1.0))


def _parsed(text: str, scenario: Scenario) -> Choices | Range:
    where = f"--vary {text}"
    key, separator, values = (part.strip() for part in text.partition("="))
    if not separator or not key or not values:
        raise InputError(f"{where}: write section.key=v1,v2,... or section.key=low:high[:log]")
    match = _RANGE.fullmatch(values)
    if match is None:
        chosen = tuple(parse_values(values))
        if len({json.dumps(value) for value in chosen}) < len(chosen):
            raise InputError(f"{where}: a value is there twice; leave one out")
        return Choices(key, chosen)
    low, high, log = float(match[1]), float(match[2]), match[3] is not None
    if not low < high:
        raise InputError(f"{where}: the range must go from a smaller to a larger number")
    if log and low <= 0.0:
        raise InputError(f"{where}: a logarithmic range must begin above zero")
    present = value_at(scenario.model_dump(), key)
    integer = isinstance(present, int) and not isinstance(present, bool)
    if integer and (log or low % 1.0 or high % 1.0):
        raise InputError(f"{where}: '{key}' is an integer; give a range of integers without log")
    return Range(key, low, high, log, integer)


def varied(scenario: Scenario, settings: Mapping[str, Any], where: str = "scenario") -> Scenario:
    """Return the scenario with these settings and vehicle parameters; nothing is compiled yet.

    Raises
    ------
    InputError
        If there is no such key, or a value breaks a rule.
    """
    parameters: dict[str, dict[str, Any]] = {"vehicle": {}, "plant": {}}
    plain = {}
    for key, value in settings.items():
        match = _PARAMETER.fullmatch(key)
        if match:
            parameters[match[1]][match[2]] = value
        else:
            plain[key] = value
    one = scenario.with_values(plain, where) if plain else scenario
    if parameters["vehicle"]:
        changes = _replaced(one.model_vehicle(), parameters["vehicle"], where)
        one = one.with_values({"vehicle_parameters": one.vehicle_parameters | changes}, where)
    if parameters["plant"]:
        driven = one.plant_vehicle() or one.model_vehicle()
        changes = one.simulation.plant_parameters | _replaced(driven, parameters["plant"], where)
        one = one.with_values({"simulation.plant_parameters": changes}, where)
    return one


def _is_possible(scenario: Scenario, settings: Mapping[str, Any], key: str) -> bool:
    try:
        _try(scenario, settings, key, "")
    except InputError:
        return False
    return True


def _try(scenario: Scenario, settings: Mapping[str, Any], key: str, where: str) -> None:
    one = varied(scenario, settings, where)
    if key.partition(".")[0] in ("vehicle", "plant", "vehicle_parameters"):
        one.model_vehicle()
    if key.startswith(("plant.", "simulation.plant")):
        one.plant_vehicle()


def _replaced(vehicle: Vehicle, values: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the parameters of a vehicle that these values change, whole."""
    data = vehicle.model_dump(mode="json")
    changed = set()
    for key, value in values.items():
        path = key.removesuffix(_FACTOR)
        if path != key:
            present = value_at(data, path)
            if not isinstance(present, (int, float, list)) or not isinstance(value, (int, float)):
                raise InputError(f"{where}: '{path}' is no number or array of the vehicle to multiply")
            value = _times(present, value)
        replace_value(data, path, value, where)
        changed.add(re.split(r"[.\[]", path)[0])
    return {name: data[name] for name in sorted(changed)}


def _times(present: Any, factor: float) -> Any:
    return [_times(part, factor) for part in present] if isinstance(present, list) else present * factor
