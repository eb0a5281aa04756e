"""The station-keeping game of one vehicle, with everything that learner and solvers share."""

from __future__ import annotations

from dataclasses import dataclass

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
