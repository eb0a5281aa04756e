"""A run again from its record alone: the scenario, the vehicle and the policy that it names."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import xarray as xr

from ...offline import OfflineSolver, Trajectory
from ...online import load
from ...online.loop import Progress
from ...online.records import read_parts
from ...symbolic import InputError
from ...symbolic.arrays import Array
from ...symbolic.pyfile import is_named
from ...symbolic.toml import validate
from ..policies import CONTENDERS
from ..scenario import Scenario, restored
from .clairvoyant import KIND as CLAIRVOYANT
from .clairvoyant import clairvoyant_or_failure, clairvoyant_provenance
from .own_program import played_back, program_of, with_program
from .provenance import FORMAT
from .record_files import as_settings, files_of
from .runs import online_record, optimum_or_failure, optimum_provenance, trajectory_of

OPTIMAL, GUESSED = "optimal from ", ", started from "


def load_run(path: str | Path) -> xr.Dataset:
    """Read the record of a run or of an optimum that this version can run again.

    Raises
    ------
    InputError
        If the file is no such record, is of another format, or was interrupted.
    """
    record = load(path)
    if "kind" not in record.attrs or "scenario" not in record.attrs:
        raise InputError(f"'{path}' is no record of a run; give one that 'online' or 'compare' wrote")
    kind, form = str(record.attrs["kind"]), record.attrs.get("format")
    if form != FORMAT:
        raise InputError(
            f"the record '{path}' has {'no format' if form is None else f'format {form}'}, but this "
            f"version runs those of format {FORMAT} again; make it again, or use the one that wrote it "
            f"(stationkeep {record.attrs.get('stationkeep_version', 'unknown')})"
        )
    known = kind in CONTENDERS or is_named(kind) or kind == CLAIRVOYANT
    if not known and not kind.startswith(OPTIMAL):
        raise InputError(
            f"'{path}' is a record of '{kind}', which can't be run again; known are optima and the "
            f"policies {', '.join(CONTENDERS)}"
        )
    if str(record.attrs.get("stopped", "")).startswith("interrupted"):
        raise InputError(
            f"the run of '{path}' was {record.attrs['stopped']}, so that there is no whole run to "
            "compare with; make the record again"
        )
    return record


def recorded_scenario(record: xr.Dataset) -> Scenario:
    """Return the scenario of a record, with the vehicle and other files that the record keeps.

    Raises
    ------
    InputError
        If this version can't read them.
    """
    data = as_settings(record.attrs["scenario"], "scenario")
    scenario = validate(
        Scenario, data, "the record's scenario, which another version may have written,"
    )
    if str(record.attrs["kind"]).startswith(
        (OPTIMAL, CLAIRVOYANT)
    ):  # doesn't depend on a basis, nor needs its file
        scenario = scenario.model_copy(
            update={"basis": scenario.basis.model_copy(update={"name": "quadratic"})}
        )
    return restored(scenario.model_dump_json(), None, files_of(record, scenario))


def run_again(
    record: xr.Dataset,
    folder: Path,
    progress: Progress | None = None,
    policy: str | None = None,
) -> xr.Dataset:
    """Return the record of the same run, made now.

    Parameters
    ----------
    record : from `load_run`
    folder : where an optimum looks for the record that it started from
    progress : called with the part of a closed loop that is done, 0 to 1; not for an optimum
    policy : "file.py:make" of the policy or the critic law of one's own that the run had; without it
        such a run's recorded inputs are played back

    Raises
    ------
    InputError
        If the record can't be read by this version, `policy` is not what the run had, or the record
        that an optimum started from is gone.
    """
    scenario, kind = recorded_scenario(record), str(record.attrs["kind"])
    program = program_of(record, scenario)
    if policy is not None and program is None:
        raise InputError(f"the record is of '{kind}', which needs no file; leave out --policy")
    if kind in CONTENDERS or program is not None:
        duration = scenario.simulation.duration
        tell = None if progress is None else lambda t: progress(t / duration)
        if program is not None and policy is None:
            return played_back(record, scenario, tell)
        if policy is not None:
            scenario, make, own = with_program(record, scenario, policy)
        else:
            make, own = CONTENDERS[kind].make, list[str]()
        return online_record(scenario, policy=lambda: make(scenario), kind=kind, own=own, progress=tell)
    if kind == CLAIRVOYANT:
        return clairvoyant_or_failure(scenario, clairvoyant_provenance(scenario))
    zeta0, key = _start(scenario, kind)
    guess = _guess(folder, key) if key else None
    solver = OfflineSolver(scenario.setup().problem, scenario.offline)
    attributes = optimum_provenance(scenario, zeta0, key)
    return optimum_or_failure(scenario, solver, zeta0, attributes, guess)


def _start(scenario: Scenario, kind: str) -> tuple[Array, str]:
    """Return the initial state of an optimum, and the key of the record that it started from."""
    numbers, _, key = kind.removeprefix(OPTIMAL).partition(GUESSED)
    try:
        problem = scenario.setup().problem
        return problem.initial_state(np.array(json.loads(numbers), dtype=float)), key
    except (ValueError, TypeError):
        raise InputError(f"the record's kind is '{kind}', but must name an initial state") from None


def _guess(folder: Path, key: str) -> Trajectory:
    for path in sorted(folder.glob("*.nc")):
        try:
            attributes, _ = read_parts(path)
        except InputError:
            continue  # another file, or one that is being written
        if attributes.get("key") == key:
            return trajectory_of(load(path))
    raise InputError(
        f"the solve started from the optimum with the key {key[:12]}..., whose record is no longer in "
        f"'{folder}'; put it there, or make both again with 'stationkeep offline'"
    )
