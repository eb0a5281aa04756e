"""The station-keeping game of one vehicle, with everything that learner and solvers share."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..compiled import Export
from ..value import Setup
from .model import Model


@dataclass(frozen=True, eq=False, kw_only=True)
class StationKeeping(Setup):
    """The setup of a vehicle's game: `problem` is `model.problem(...)`.

    Attributes
    ----------
    model : the vehicle's dynamics
    """

    model: Model

    def exports(self, n_samples: int) -> Iterator[Export]:
        """Build every function of vehicle and setup and yield what became of it."""
        yield from self.model.exports()
        yield from super().exports(n_samples)
