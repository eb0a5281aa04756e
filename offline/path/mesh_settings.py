"""How long, how fine and of which order a mesh is: the settings that the solvers start from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, TypedDict, Unpack

import numpy as np

from ...symbolic import InputError, Problem
from ...symbolic.arrays import Array
from .mesh import graded_mesh, growing_mesh

LONGEST_FIRST = 1.0  # interval, in time constants of the fastest mode of the closed loop
SHORTEST = 7.0  # horizon, in time constants of its slowest mode


class MeshChanges(TypedDict, total=False):
    """Single settings of a mesh, as keywords."""

    horizon: float
    n_intervals: int
    degree: int
    grading: float


@dataclass(frozen=True)
class MeshSettings:
    """A mesh graded towards t = 0, with collocation points on each interval.

    Attributes
    ----------
    horizon : T [s]; after it the cost is ζ(T)'P ζ(T)
    n_intervals : K
    degree : d, collocation points an interval
    grading : about the logarithm of the ratio of the last to the first interval; 0 is uniform

    Raises
    ------
    InputError
        If a setting is not positive, or the grading negative.
    """

    horizon: float
    n_intervals: int
    degree: int
    grading: float

    direct: ClassVar[MeshSettings]
    certified: ClassVar[MeshSettings]
    saddle: ClassVar[MeshSettings]
    quick: ClassVar[MeshSettings]
    fine: ClassVar[MeshSettings]
    prediction: ClassVar[MeshSettings]

    def __post_init__(self) -> None:
        least = min(self.horizon, self.n_intervals, self.degree)
        if not (least > 0.0 and self.horizon < np.inf and 0.0 <= self.grading < np.inf):
            raise InputError(
                "a mesh needs a finite horizon, intervals and a degree above 0 and a grading of 0 or "
                f"more, but was given {self}"
            )

    def __str__(self) -> str:
        return (
            f"{self.n_intervals} intervals of degree {self.degree}, graded by {self.grading:g}, over "
            f"{self.horizon:g} s"
        )

    @property
    def points(self) -> Array:
        """Interval ends, shape (K + 1,) [s]."""
        return graded_mesh(self.horizon, self.n_intervals, self.grading)

    def changed(self, **changes: Unpack[MeshChanges]) -> MeshSettings:
        """Return these settings with others in the place of some."""
        return replace(self, **changes)

    def lengthened(self, horizon: float) -> MeshSettings:
        """Return the settings of a longer horizon [s]; the first intervals stay about as they are."""
        longer = horizon / self.horizon
        grading, more = 0.0, longer
        if self.grading > 0.0:
            grading = self.grading + float(np.log(longer))
            more = min(grading / self.grading, longer)
        return MeshSettings(horizon, int(np.ceil(more * self.n_intervals)), self.degree, grading)

    def resolving(self, rate: float) -> MeshSettings:
        """Return settings whose first interval is no longer than the time constant of a `rate` [1/s].

        Graded more steeply, with as many more intervals as keep the ratio of neighbours. A longer first
        interval would take the fastest mode for a kink, and the long ones behind it would allow
        extremals that no trajectory has. Uniform meshes are returned as they are.
        """
        times = float(self.points[1] * rate) / LONGEST_FIRST
        if times <= 1.0 or self.grading == 0.0:
            return self
        grading = self.grading + float(np.log(times))
        n_intervals = int(np.ceil(self.n_intervals * grading / self.grading))
        return self.changed(grading=grading, n_intervals=n_intervals)

    def suited(self, problem: Problem) -> MeshSettings:
        """Return settings that outlast the slowest mode of the closed loop and resolve the fastest.

        These settings themselves where they do so already, as for every shipped vehicle.
        """
        least = SHORTEST / problem.decay_rate
        longer = self if self.horizon >= least else self.lengthened(least)
        return longer.resolving(problem.fastest_rate)


# one solve by itself, neither aligned nor refined: to 1e-5 of the value from the shipped envelope
MeshSettings.direct = MeshSettings(horizon=120.0, n_intervals=40, degree=5, grading=5.0)
# where the certified solve starts to refine; its horizon follows the closed loop, if none is asked for
MeshSettings.certified = MeshSettings(horizon=120.0, n_intervals=24, degree=6, grading=5.0)
# Gauss points, of a higher order than as many Radau points; not the mesh of the direct solve
MeshSettings.saddle = MeshSettings(horizon=120.0, n_intervals=30, degree=6, grading=6.0)
# a value to about 1e-6 of itself in the least time
MeshSettings.quick = MeshSettings(horizon=60.0, n_intervals=16, degree=6, grading=6.0)
# a value to about 4e-8 of itself (7e-7 at worst in the shipped envelope), for regrets of 1e-5
MeshSettings.fine = MeshSettings(horizon=60.0, n_intervals=30, degree=6, grading=6.0)
# model predictive control: solved ten times a second, with ζ'P ζ as the rest after a few seconds
MeshSettings.prediction = MeshSettings(horizon=3.0, n_intervals=5, degree=4, grading=1.5)


@dataclass(frozen=True)
class GrowingMesh:
    """A mesh that starts anew at every break of what drives the plant, and its degree.

    Attributes
    ----------
    shortest, longest : intervals after a break, and where they have grown [s]
    degree : d, collocation points an interval
    """

    shortest: float
    longest: float
    degree: int

    def points(self, horizon: float, breaks: Array) -> Array:
        """Return the interval ends on [0, T] with one at every break, (K + 1,) [s]."""
        return growing_mesh(horizon, breaks, shortest=self.shortest, longest=self.longest)


# against a disturbance that is known: a control answers within the first tenth of a second
CLAIRVOYANT = GrowingMesh(shortest=0.1, longest=1.0, degree=5)
