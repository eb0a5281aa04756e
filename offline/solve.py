"""The offline optimum with its certificate: value, costate and policies whose error is known."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np

from ..symbolic import Problem
from ..symbolic.vehicle import Array
from .direct import DirectSolution, DirectSolver
from .mesh import aligned_mesh
from .settings import OfflineSettings


@dataclass(frozen=True)
class Certificate:
    """What is known of the error of a solution; none of it is the solver's own status.

    Attributes
    ----------
    value_error : relative; mesh refinement (K to 2K), re-integration and horizon together
    defect : largest gap of the re-integrated trajectory to the collocated one, in half-widths
    hji_residual : |H| of (7) at ζ with the costate, relative to ζ'Qζ
    costate_error : costate against a central difference of the value along a random direction, and
        its change on a finer mesh, relative to the costate's norm in half-widths
    horizon_error : relative change of the value when the horizon is doubled
    """

    value_error: float
    defect: float
    hji_residual: float
    costate_error: float
    horizon_error: float

    def faults(self, settings: OfflineSettings) -> list[str]:
        """Return what breaks the tolerances, in words; empty if the certificate holds."""
        limits = {
            "value_error": settings.value_tolerance,
            "defect": settings.defect_tolerance,
            "hji_residual": settings.hji_tolerance,
            "costate_error": settings.costate_tolerance,
        }
        values = asdict(self)
        return [
            f"{name} is {values[name]:.1e}, over {limit:.0e}"
            for name, limit in limits.items()
            if not values[name] <= limit
        ]


@dataclass(frozen=True)
class OfflineSolution:
    """The optimum of the game from one state.

    Attributes
    ----------
    direct : value, costate, policies and trajectory
    certificate : its error
    faults : what breaks the tolerances; empty if the certificate holds
    seconds : wall time, certificate included
    """

    direct: DirectSolution
    certificate: Certificate
    faults: list[str]
    seconds: float

    @property
    def value(self) -> float:
        """V(ζ)."""
        return self.direct.value

    @property
    def costate(self) -> Array:
        """Gradient of V at ζ, shape (n,)."""
        return self.direct.costate


class OfflineSolver:
    """Certified solves of one problem; the programs are built once."""

    def __init__(self, problem: Problem, settings: OfflineSettings | None = None) -> None:
        self.problem = problem
        self.settings = OfflineSettings() if settings is None else settings
        self.direct = self._solver(1, 1)

    def solve(self, zeta0: Array) -> OfflineSolution:
        """Return the optimum from `zeta0` and its certificate.

        Raises
        ------
        InputError
            If the state is not finite, of the wrong shape or pitched by 90 degrees.
        RunError
            If IPOPT does not converge.
        """
        started = time.perf_counter()
        if self.settings.aligned:
            solution, events = self.direct.solve_aligned(zeta0)
        else:
            solution, events = self.direct.solve(zeta0), np.empty(0)
        certificate = self._certify(solution, events)
        return OfflineSolution(
            direct=solution,
            certificate=certificate,
            faults=certificate.faults(self.settings),
            seconds=time.perf_counter() - started,
        )

    def _certify(self, solution: DirectSolution, events: Array) -> Certificate:
        value = max(abs(solution.value), np.finfo(float).tiny)
        finer, longer = (
            solver.solve(
                solution.zeta,
                mesh=aligned_mesh(solver.mesh, events),
                guess=solution.trajectory,
                verify=False,
            )
            for solver in (self._finer, self._longer)
        )
        refinement = abs(finer.value - solution.value) / value
        integration = abs(solution.reintegrated_value - solution.value) / value
        horizon = abs(longer.value - finer.value) / value
        return Certificate(
            value_error=refinement + integration + horizon,
            defect=solution.defect,
            hji_residual=solution.hji_residual,
            costate_error=self._costate_error(solution, longer),
            horizon_error=horizon,
        )

    def _costate_error(
        self, solution: DirectSolution, better: DirectSolution, step: float = 1e-3
    ) -> float:
        """Compare λ'd with (V(ζ + h d) - V(ζ - h d)) / 2h, d a seeded direction in half-widths."""
        scale = self.problem.scale
        direction = np.random.default_rng(0).standard_normal(len(scale))
        direction *= scale / np.linalg.norm(direction)
        ahead, behind = (
            self.direct.solve(
                solution.zeta + h * direction,
                mesh=solution.trajectory.mesh,
                guess=solution.trajectory,
                verify=False,
            ).value
            for h in (step, -step)
        )
        difference = (ahead - behind) / (2.0 * step)
        # near the origin, relative to the gradient at the size of the difference step
        least = 1e-3 * float(np.linalg.norm(2.0 * self.problem.P @ scale * scale))
        norm = max(float(np.linalg.norm(solution.costate * scale)), least)
        refinement = float(np.linalg.norm((better.costate - solution.costate) * scale))
        return (abs(float(solution.costate @ direction) - difference) + refinement) / norm

    @cached_property
    def _finer(self) -> DirectSolver:
        return self._solver(2, 1)

    @cached_property
    def _longer(self) -> DirectSolver:
        return self._solver(2, 2)

    def _solver(self, finer: int, longer: int) -> DirectSolver:
        settings = self.settings
        # the graded mesh of twice the horizon keeps its first intervals with log(2) more grading
        return DirectSolver(
            self.problem,
            horizon=longer * settings.horizon,
            n_intervals=finer * settings.intervals,
            degree=settings.degree,
            grading=settings.grading + (np.log(longer) if settings.grading > 0.0 else 0.0),
        )


def solve(problem: Problem, zeta0: Array, settings: OfflineSettings | None = None) -> OfflineSolution:
    """Return the certified optimum of a game from one state; see `OfflineSolver` for many."""
    return OfflineSolver(problem, settings).solve(zeta0)
