"""The paper's conditions of a scenario, or of a run of it: what `stationkeep check` lists."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from ...online import load
from ...symbolic import InputError
from ..optima import load_ideal
from ..records import recorded_scenario
from ..scenario import Scenario
from .condition import Condition
from .conditions import scenario_conditions
from .run_conditions import run_conditions
from .theory import require_run, theory


def check(
    scenario: Scenario | str | None = None,
    record: xr.Dataset | Path | None = None,
    ideal_weights: Path | None = None,
) -> list[Condition]:
    """Return every assumption and condition of the paper with its number.

    Parameters
    ----------
    scenario : what is looked at, or its name; that of the record if None
    record : of a run that learned, or its path; what the run made of the conditions is added
    ideal_weights : file of `stationkeep offline --ideal-weights`, for what needs ε and ε'

    Raises
    ------
    InputError
        If there is neither a scenario nor a record, the record is of another scenario or holds no run
        that learned, or the ideal weights belong to something else.
    """
    if isinstance(scenario, str):
        scenario = Scenario.load(scenario)
    name = str(record) if isinstance(record, Path) else "the record"
    run = load(record) if isinstance(record, Path) else record
    if run is not None:
        require_run(run, name)
        scenario = _of_run(run, scenario, name)
    if scenario is None:
        raise InputError("there is nothing to check; give a scenario, or the record of a run")
    ideal = None if ideal_weights is None else load_ideal(scenario, ideal_weights)
    bounds = None if ideal is None else ideal.bounds
    if run is None:
        return scenario_conditions(scenario, bounds)
    found = None if ideal is None else theory(scenario, run, ideal)
    listed = scenario_conditions(scenario, bounds, float(run["rank_margin"].min()))
    return listed + run_conditions(scenario, run, found)


def _of_run(record: xr.Dataset, scenario: Scenario | None, name: str) -> Scenario:
    """Return the scenario of a run: the one given if it is that, else from the record."""
    text = record.attrs.get("scenario")
    if text is None:
        raise InputError(f"'{name}' does not say what was run; make it again")
    if scenario is None:
        return recorded_scenario(record)
    if text != scenario.model_dump_json():
        raise InputError(f"'{name}' is a run of another scenario; leave the scenario out, or the run")
    return scenario
