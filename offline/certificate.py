"""What is known of the error of a solution; none of it is the solver's own status."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from .direct import DirectSolution
from .settings import OfflineSettings


@dataclass(frozen=True)
class Certificate:
    """The evidence for one solution; a number that is not known is NaN.

    Attributes
    ----------
    value_error : relative; the sum of refinement_error, integration_error, horizon_error and
        disagreement
    defect : largest gap of the re-integrated trajectory to the collocated one, in half-widths
    hji_residual : |H| of (7) at ζ with the costate, relative to ζ'Qζ
    costate_error : costate against a central difference of the value along a random direction, and
        its change on a finer mesh and a longer horizon, relative to the costate's norm in half-widths
    horizon_error : relative change of the value when the horizon is doubled
    refinement_error : relative change of the value when every interval is halved
    integration_error : relative gap of the value by re-integration
    disagreement : relative gap to the value of the saddle point, solved by itself (`saddle.py`)
    second_order : whether the minimum is strict: no conjugate point inside the horizon
    gradient_unique : False where another minimum, with another costate, has the same value
    """

    value_error: float
    defect: float
    hji_residual: float
    costate_error: float
    horizon_error: float
    refinement_error: float
    integration_error: float
    disagreement: float
    second_order: bool
    gradient_unique: bool

    @classmethod
    def unknown(cls, solution: DirectSolution) -> Certificate:
        """Return what is known of a solution by itself: nothing of the error of its value."""
        value = max(abs(solution.value), np.finfo(float).tiny)
        return cls(
            value_error=math.nan,
            defect=solution.defect,
            hji_residual=solution.hji_residual,
            costate_error=math.nan,
            horizon_error=math.nan,
            refinement_error=math.nan,
            integration_error=abs(solution.reintegrated_value - solution.value) / value,
            disagreement=math.nan,
            second_order=solution.second_order,
            gradient_unique=True,
        )

    def faults(self, settings: OfflineSettings) -> list[str]:
        """Return what breaks the tolerances, in words; empty if the certificate holds."""
        limits = {
            "value_error": settings.value_tolerance,
            "defect": settings.defect_tolerance,
            "hji_residual": settings.hji_tolerance,
            "costate_error": settings.costate_tolerance,
        }
        values = asdict(self)
        found = [
            f"{name} is not known"
            if math.isnan(values[name])
            else f"{name} is {values[name]:.1e}, over {limit:.0e}"
            for name, limit in limits.items()
            if not values[name] <= limit
        ]
        if not self.second_order:
            found.append("the extremal has a conjugate point and is no strict minimum")
        return found
