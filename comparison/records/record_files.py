"""The files of a scenario inside a record: kept with it, so that it can be run without them."""

from __future__ import annotations

import json
from typing import Any

import casadi
import numpy as np
import xarray as xr
from casadi import SX

from ...symbolic import InputError, Vehicle
from ...symbolic.expressions import from_data, to_data
from ...symbolic.game import problem_from_data
from ...symbolic.toml import validate
from ..scenario import Files, Scenario

WEIGHTS, BASIS = "initial_weights", "basis_function"  # variables of a record


def with_files(record: xr.Dataset, scenario: Scenario) -> xr.Dataset:
    """Return the record of an online run with the weights and the basis that came from a user's files.

    A basis is kept as its instructions, since its file may import others.
    """
    weights = scenario.initial_weights()
    if weights is not None:
        record[WEIGHTS] = (("initial_weight",), weights, {"units": "cost"})
    if ":" in scenario.basis.name:
        x = SX.sym("x", scenario.setup().problem.n_states)
        function = casadi.Function("basis", [x], [scenario.basis_function()(x)], ["x"], ["sigma"])
        record[BASIS] = ((), json.dumps(to_data(function)), {"units": "1"})
    return record


def files_of(record: xr.Dataset, scenario: Scenario) -> Files:
    """Return the files that a record keeps of its scenario.

    Raises
    ------
    InputError
        If they can't be read by this version, or one is missing.
    """
    try:
        vehicles, problems, bases = {}, {}, {}
        if scenario.vehicle is not None:
            vehicles[scenario.vehicle] = _vehicle(record, "vehicle")
        if scenario.problem is not None:
            data = as_settings(record.attrs["problem"], "problem")
            problems[scenario.problem] = problem_from_data(data)
        if scenario.simulation.plant is not None and record.attrs["plant"]:
            vehicles[scenario.simulation.plant] = _vehicle(record, "plant")
        if BASIS in record:
            data = as_settings(str(record[BASIS].values), "basis")
            bases[scenario.basis.name] = from_data(data)
        elif ":" in scenario.basis.name:
            raise KeyError(BASIS)  # its file is not looked for
    except KeyError as error:
        raise InputError(f"the record has no attribute {error}; make it again") from None
    weights = np.array(record[WEIGHTS].values, dtype=np.float64) if WEIGHTS in record else None
    return Files(vehicles, problems, bases, weights)


def _vehicle(record: xr.Dataset, name: str) -> Vehicle:
    return validate(Vehicle, as_settings(record.attrs[name], name), f"the record's {name}")


def as_settings(text: Any, name: str) -> dict[str, Any]:
    """Return the settings in an attribute's text.

    Raises
    ------
    InputError
        If it is not the JSON text of settings.
    """
    try:
        data = json.loads(str(text))
    except ValueError:
        data = None
    if not isinstance(data, dict):
        raise InputError(f"the record's {name} can't be read, it is damaged; make it again")
    return data
