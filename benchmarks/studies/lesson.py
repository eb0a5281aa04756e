"""A learning run whose weights are used later, and what would have been known had it ended earlier."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from stationkeep.comparison.merit import game_cost
from stationkeep.comparison.records import provenance
from stationkeep.comparison.scenario import Scenario
from stationkeep.online import Controller, load, run, save, to_dataset
from stationkeep.symbolic import InputError
from stationkeep.symbolic.arrays import Array

from .cases import Case, finished
from .kept import key_of


@dataclass(frozen=True)
class Lesson:
    """What one run remembers of the envelope, and when.

    Attributes
    ----------
    path : of the run's record, for `learner.weights`
    times : (T,) [s], every second and the end
    weights : (T, m) remembered at these times
    cost : of the run in the game; infinite if it ended early
    stopped : why it ended early, or None
    """

    path: Path
    times: Array
    weights: Array
    cost: float
    stopped: str | None


def lesson(scenario: Scenario, case: Case, zeta: Array, folder: Path) -> Lesson:
    """Return the lesson of a case's run from ζ_0; the one in `folder` if it is this very one.

    Raises
    ------
    InputError
        If the folder can't be written.
    """
    taught = case.scenario(scenario).with_settings(
        simulation={"initial_state": tuple(zeta.tolist())}, samples={"remember": True}
    )
    attributes = provenance(taught, "lesson")
    path = folder / f"lesson-{key_of(attributes['key'])[:16]}.nc"
    P = scenario.station_keeping().problem.P
    try:
        return _read(path, P)
    except InputError:
        _teach(taught, path, attributes)
        return _read(path, P)


def _teach(taught: Scenario, path: Path, attributes: dict[str, object]) -> None:
    controller = Controller(taught)
    memory = controller.learner.memory
    assert memory is not None
    times, weights = [0.0], [memory.weights]

    def note(t: float) -> None:
        if t >= times[-1] + 1.0 - 1e-9:
            times.append(t)
            weights.append(memory.weights)

    history = finished(run(taught, controller, note))
    record = to_dataset(history, attributes)
    record["noted"] = (("note_time", "basis"), np.array(weights), {"units": "cost"})
    save(record.assign_coords(note_time=("note_time", np.array(times), {"units": "s"})), path)


def _read(path: Path, P: Array) -> Lesson:
    record = load(path)
    return Lesson(
        path=path,
        times=record["note_time"].values,
        weights=record["noted"].values,
        cost=game_cost(record, P),
        stopped=str(record.attrs["stopped"]) or None,
    )
