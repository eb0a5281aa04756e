"""The domain of a plant for whole trajectories: outside of it the equations have no meaning."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi
import numpy as np
from casadi import SX

from ...symbolic import Bound, RunError
from ...symbolic.arrays import Array
from ...symbolic.game import margins_and_shown, outside


class Domain:
    """Where the bounds of a plant hold.

    Parameters
    ----------
    zeta : (n,) symbol of the bounds
    bounds : all of them, none for the whole space
    """

    def __init__(self, zeta: SX, bounds: Sequence[Bound]) -> None:
        self.bounds = tuple(bounds)
        self._zeta = zeta

    def require(self, times: Array, states: Array) -> None:
        """Refuse a trajectory with `states` (N, n) at `times` (N,) [s] that leaves the domain.

        Raises
        ------
        RunError
            If a state is outside; the message names the first such time and says the bound's sentence.
        """
        if not self.bounds:
            return
        margins = np.array(self._function(states.T)[0])
        lost = ~(margins > 0.0).all(axis=0)
        if lost.any():
            first = int(np.argmax(lost))
            sentence = outside(self.bounds, self._function, states[first])
            raise RunError(f"after {times[first]:.3g} s the trajectory leaves the domain: {sentence}")

    @cached_property
    def _function(self) -> casadi.Function:
        return margins_and_shown(self._zeta, self.bounds)
