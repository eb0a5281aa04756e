"""Settings of the offline solve; the `[offline]` group of a scenario."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from ..symbolic.settings import Settings


class OfflineSettings(Settings):
    """Collocation of the offline optimum.

    Attributes
    ----------
    horizon : [s]; after it the cost is ζ(T)'P ζ(T)
    intervals : K, before the mesh is aligned with the velocity sign changes
    degree : Radau points an interval
    grading : about the logarithm of the ratio of the last to the first interval; 0 is uniform
    aligned : put mesh points where the velocities change sign
    value_tolerance : largest relative value error of a solve that counts as converged
    defect_tolerance : largest gap to the re-integrated trajectory, in half-widths
    hji_tolerance : largest residual of (7), relative to the state cost
    costate_tolerance : largest relative gap to the finite difference of the value
    """

    horizon: PositiveFloat = 120.0
    intervals: PositiveInt = 40
    degree: Annotated[int, Field(ge=1, le=9)] = 5
    grading: NonNegativeFloat = 5.0
    aligned: bool = True
    value_tolerance: PositiveFloat = 1e-6
    defect_tolerance: PositiveFloat = 1e-6
    hji_tolerance: PositiveFloat = 1e-6
    costate_tolerance: PositiveFloat = 1e-4
