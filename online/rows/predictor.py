"""What policies are predicted to cost from a state, by the model, over a horizon."""

from __future__ import annotations

from ...symbolic import ValueFunctions
from ...symbolic.arrays import Array
from .paths import PathRows, RelativeTo


class Predictor:
    """Predicted costs, and rows along predicted paths.

    Parameters
    ----------
    functions : of problem and basis
    horizon : of the paths [s]; after it the cost is ζ'P ζ
    n_steps : of the integration over the horizon, growing
    """

    def __init__(self, functions: ValueFunctions, horizon: float, n_steps: int) -> None:
        self._prediction = functions.prediction(horizon, n_steps)

    @property
    def method(self) -> str:
        """What integrates, in words."""
        stepping = self._prediction.stepping
        return f"{len(stepping.steps)} steps of {stepping.method}"

    def cost(self, zeta: Array, actor_1: Array, actor_2: Array) -> float:
        """Return J from ζ (n,) of the policies (14)(15), infinite if they lose the vehicle."""
        return self._prediction.path(zeta, actor_1, actor_2).cost

    def linear_cost(self, zeta: Array) -> float:
        """Return J from ζ (n,) of the linear H-infinity policy, likewise."""
        return self._prediction.linear_path(zeta).cost

    def path_rows(self, points: int, relative_to: RelativeTo = "rest") -> PathRows:
        """Return the rows of the costate error along its paths, at so many points of each."""
        return PathRows(self._prediction, points, relative_to)
