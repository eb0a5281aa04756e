"""Settings of the offline solve; the `[offline]` group of a scenario."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from ..symbolic.toml import Settings

Method = Literal["newton", "ipopt"]


class OfflineSettings(Settings):
    """Collocation of the offline optimum.

    Attributes
    ----------
    horizon : [s]; after it the cost is ζ(T)'P ζ(T). None chooses it by the decay of the closed loop
    intervals : K at the start, before alignment with the velocity sign changes and refinement
    degree : Radau points an interval at the start
    grading : about the logarithm of the ratio of the last to the first interval; 0 is uniform
    aligned : put mesh points where the velocities change sign
    rounds : of refinement at most; 1 solves on the first mesh only
    starts : pairs of continuations that look for other extremals; 0 looks for none
    method : "newton", the structured Newton method where the plant is fully actuated and IPOPT
        elsewhere, or "ipopt" always
    value_tolerance : largest relative value error of a solve that counts as converged
    defect_tolerance : largest gap to the re-integrated trajectory, in half-widths
    hji_tolerance : largest residual of (7), relative to the state cost
    costate_tolerance : largest relative gap to the finite difference of the value
    """

    horizon: PositiveFloat | None = None
    intervals: PositiveInt = 24
    degree: Annotated[int, Field(ge=1, le=8)] = 6
    grading: NonNegativeFloat = 5.0
    aligned: bool = True
    rounds: PositiveInt = 5
    starts: NonNegativeInt = 4
    method: Method = "newton"
    value_tolerance: PositiveFloat = 1e-7
    defect_tolerance: PositiveFloat = 1e-6
    hji_tolerance: PositiveFloat = 1e-7
    costate_tolerance: PositiveFloat = 1e-5
