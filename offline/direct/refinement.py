"""A mesh and a degree that reach a requested error, driven by an estimate of it.

On a mesh aligned with the sign changes of the switching functions the solution of degree d is compared
with that of degree d + 1. Because the cost is stationary, a control that is wrong by δv costs the
integral of δv'R_eff δv more (exactly so for a linear-quadratic game), which gives each interval its
share:

    e_i = ∫_i (v_{d+1} - v_d)'R_eff (v_{d+1} - v_d) dt / V.

Intervals over their share are halved (h). Where most are over it, or the value is right but a
pointwise condition (defect, residual, costate) is not, the degree is raised instead (p).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...symbolic.arrays import Array
from ..path import Trajectory, halved
from ..settings import OfflineSettings
from .direct import DirectSolution, DirectSolver

HIGHEST_DEGREE = 9  # of the Radau points that CasADi knows


@dataclass(frozen=True)
class Refined:
    """A solution, the same on the same mesh with one degree more, and how it came about.

    Attributes
    ----------
    solution : re-integrated
    better : of one degree more
    events : (e,) sign changes of switching functions, where the mesh has points [s]
    rounds : of refinement
    """

    solution: DirectSolution
    better: DirectSolution
    events: Array
    rounds: int

    @property
    def value_error(self) -> float:
        """Relative change of the value by one degree more."""
        return abs(self.better.value - self.solution.value) / _size(self.solution)

    def costate_change(self, scale: Array) -> float:
        """Relative change of the costate by one degree more, in half-widths."""
        change = np.linalg.norm((self.better.costate - self.solution.costate) * scale)
        return float(change / max(float(np.linalg.norm(self.solution.costate * scale)), 1e-300))


def refine(
    direct: DirectSolver, settings: OfflineSettings, zeta0: Array, guess: Trajectory | None = None
) -> Refined:
    """Return the solution from `zeta0` that meets the tolerances of `settings`, or the last tried.

    Raises
    ------
    InputError, RunError
        As the solver does.
    """
    mesh, degree, iterations, seconds = direct.mesh, settings.degree, 0, 0.0
    for round_ in range(1, settings.rounds + 1):
        refined = _attempt(direct, settings, zeta0, mesh, degree, guess, round_)
        iterations += refined.solution.iterations
        seconds += refined.solution.seconds
        if round_ == settings.rounds or _good_enough(refined, settings, direct.problem.scale):
            break
        shares = interval_errors(direct, refined)
        over = shares > 0.1 * settings.value_tolerance / len(shares)
        smooth = 2 * over.sum() > len(over) or not over.any()
        if smooth and degree < HIGHEST_DEGREE - 1:
            degree += 1
        else:
            mesh = halved(refined.solution.trajectory.mesh, over if over.any() else ~over)
        guess = refined.better.trajectory
    total = replace(refined.solution, iterations=iterations, seconds=seconds)
    return replace(refined, solution=total)


def interval_errors(direct: DirectSolver, refined: Refined) -> Array:
    """Return the share e_i of each interval in the relative value error, shape (K,)."""
    coarse, fine = refined.solution.trajectory, refined.better.trajectory
    return input_errors(coarse, fine, direct.problem.game.R_eff) / _size(refined.solution)


def input_errors(coarse: Trajectory, fine: Trajectory, R: Array) -> Array:
    """Return ∫ (v_fine - v_coarse)'R (v_fine - v_coarse) dt on each interval of their mesh, (K,)."""
    times = fine.times[1:]
    d = fine.degree
    # a Radau point at an interval's end belongs to it, not to the next
    inside = times - 1e-9 * np.repeat(np.diff(fine.mesh), d)
    gap = coarse.sample(inside)[1] - fine.v
    density = np.sum((gap @ R) * gap, axis=1).reshape(-1, d)
    _, weights = fine.rule.coefficients
    return np.asarray(np.diff(fine.mesh) * (density @ weights))


def _attempt(
    direct: DirectSolver,
    settings: OfflineSettings,
    zeta0: Array,
    mesh: Array,
    degree: int,
    guess: Trajectory | None,
    round_: int,
) -> Refined:
    if settings.aligned:
        solution, events = direct.solve_aligned(zeta0, mesh=mesh, degree=degree, guess=guess)
    else:
        solution = direct.solve(zeta0, mesh=mesh, degree=degree, guess=guess)
        events = np.empty(0)
    path = solution.trajectory
    better = direct.solve(zeta0, mesh=path.mesh, degree=degree + 1, guess=path, verify=False)
    return Refined(solution, better, events, round_)


def _good_enough(refined: Refined, settings: OfflineSettings, scale: Array) -> bool:
    """Whether the tolerances hold, with room for the parts of the certificate that come later."""
    solution = refined.solution
    return (
        refined.value_error <= 0.1 * settings.value_tolerance
        and solution.defect <= 0.5 * settings.defect_tolerance
        and solution.hji_residual <= 0.5 * settings.hji_tolerance
        and refined.costate_change(scale) <= 0.1 * settings.costate_tolerance
    )


def _size(solution: DirectSolution) -> float:
    return max(abs(solution.value), np.finfo(float).tiny)
