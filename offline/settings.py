"""Settings of the offline solve; the `[offline]` group of a scenario."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from ..symbolic import Problem
from ..symbolic.toml import Settings
from .limits import Limits
from .path import MeshSettings

Method = Literal["newton", "ipopt"]


class OfflineSettings(Settings):
    """Collocation of the offline optimum.

    Attributes
    ----------
    horizon : [s]; after it the cost is ζ(T)'P ζ(T). None chooses it by the decay of the closed loop
    intervals : K at the start, before alignment and refinement; more for a fast problem, unless it or
        the grading is chosen
    degree : Radau points an interval at the start
    grading : about the logarithm of the ratio of the last to the first interval; 0 is uniform
    aligned : put mesh points where switching functions change sign, such as the velocities under drag
    rounds : of refinement at most; 1 solves on the first mesh only
    starts : pairs of continuations that look for other extremals; 0 looks for none
    method : "newton", the structured Newton method where the plant is fully actuated and IPOPT
        elsewhere, or "ipopt" always
    max_iterations, max_seconds : of a solve, all of its parts together, its certificate too; one that
        reaches them ends with the reason and what it has [-, s]
    value_tolerance : largest relative value error of a solve that counts as converged
    defect_tolerance : largest gap to the re-integrated trajectory, in half-widths
    hji_tolerance : largest residual of (7), relative to the state cost
    costate_tolerance : largest relative gap to the finite difference of the value
    """

    horizon: Annotated[float, Field(gt=0.0, le=1e6)] | None = None
    intervals: Annotated[int, Field(ge=1, le=10_000)] = MeshSettings.certified.n_intervals
    degree: Annotated[int, Field(ge=1, le=8)] = MeshSettings.certified.degree
    grading: Annotated[float, Field(ge=0.0, le=100.0)] = MeshSettings.certified.grading
    aligned: bool = True
    rounds: Annotated[int, Field(ge=1, le=100)] = 5
    starts: Annotated[int, Field(ge=0, le=1000)] = 4
    method: Method = "newton"
    max_iterations: Annotated[int, Field(ge=1, le=10**9)] = 10_000
    max_seconds: PositiveFloat = 300.0
    value_tolerance: PositiveFloat = 1e-7
    defect_tolerance: PositiveFloat = 1e-6
    hji_tolerance: PositiveFloat = 1e-7
    costate_tolerance: PositiveFloat = 1e-5

    @property
    def limits(self) -> Limits:
        """The limits of a solve."""
        return Limits(self.max_iterations, self.max_seconds)

    def mesh(self, problem: Problem) -> MeshSettings:
        """Return the first mesh, over `horizon_of`.

        Where neither intervals nor grading differ from their defaults, they are made to resolve the
        fastest mode; what is asked for is what the mesh has.
        """
        asked = MeshSettings(horizon_of(problem, self), self.intervals, self.degree, self.grading)
        default = MeshSettings.certified
        chosen = (self.intervals, self.grading) != (default.n_intervals, default.grading)
        return asked if chosen else asked.resolving(problem.fastest_rate)


def horizon_of(problem: Problem, settings: OfflineSettings) -> float:
    """Return T [s], that of the settings or one after which the closed loop has decayed enough.

    The state falls like e^(-α T), α the slowest rate of the linearised closed loop, and the cost to go
    like its square; T makes that a hundredth of the requested value error, and of the costate's.
    Doubling T is part of the certificate.
    """
    if settings.horizon is not None:
        return settings.horizon
    by_value = -np.log(0.01 * settings.value_tolerance) / 2.0
    by_costate = -np.log(0.01 * settings.costate_tolerance) / 2.0
    return float(max(by_value, by_costate) / problem.decay_rate)
