"""The offline optimum with its certificate: value, costate and policies whose error is known."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..symbolic import Problem, RunError
from ..symbolic.arrays import Array
from .certificate import Certificate
from .direct import (
    DirectSolution,
    DirectSolver,
    Refined,
    aligned_extremals,
    by_turns,
    find_extremals,
    refine,
)
from .limits import LimitError, Work, limited
from .path import MeshSettings, Trajectory, extended, halved
from .saddle import SaddleSolution, SaddleSolver
from .settings import OfflineSettings, horizon_of


@dataclass(frozen=True)
class OfflineSolution:
    """The optimum of the game from one state.

    Attributes
    ----------
    direct : value, costate, policies and trajectory
    saddle : the saddle point solved by itself; None where it was not found
    others : further extremals, the cheapest first, each on its own aligned mesh
    certificate : the error of `direct`
    faults : what breaks the tolerances; empty if the certificate holds
    turns : (n,) whole periods by which the cheapest start is written off the short way
    rounds : of mesh refinement; 0 where it was not finished
    ended : why the solve ended before its certificate was complete, or nothing
    seconds : wall time, certificate included
    """

    direct: DirectSolution
    saddle: SaddleSolution | None
    others: list[DirectSolution]
    certificate: Certificate
    faults: list[str]
    turns: tuple[int, ...]
    rounds: int
    ended: str
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
        self.horizon = horizon_of(problem, self.settings)
        self.direct = DirectSolver(problem, self.settings.mesh(problem), method=self.settings.method)

    def solve(self, zeta0: Array, guess: Trajectory | None = None) -> OfflineSolution:
        """Return the optimum from `zeta0` and its certificate.

        Near half a turn both turns are solved, and the cheaper one is the optimum; see `Angles`.
        `guess` is where the first solve starts, instead of the linear H-infinity policy; the other
        starts of the search for extremals, and the saddle point, don't use it. A solve that reaches the
        limits of the settings after it has found an optimum returns that, with what is known of it, and
        `ended` is the first of its faults.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        EndedByLimitError
            If the limits are reached before the first optimum is found.
        RunError
            If no solver converges inside the domain.
        """
        started, ended = time.perf_counter(), ""
        with limited(self.settings.limits) as work:
            firsts = self._by_turns(zeta0, guess)
            solution = min(firsts, key=lambda first: first.value)
            saddle, others, rounds = None, list[DirectSolution](), 0
            certificate = Certificate.unknown(solution)
            try:
                refined, others = self._cheapest(firsts)
                solution, rounds = refined.solution, refined.rounds
                certificate = Certificate.unknown(solution)
                saddle = self._saddle_point(solution)
                certificate = self._certify(refined, others, saddle)
            except LimitError as limit:
                ended = _own(limit, work)
        return OfflineSolution(
            direct=solution,
            saddle=saddle,
            others=others,
            certificate=certificate,
            faults=[ended] * bool(ended) + certificate.faults(self.settings),
            turns=tuple(int(n) for n in self.problem.angles.turns(solution.zeta)),
            rounds=rounds,
            ended=ended,
            seconds=time.perf_counter() - started,
        )

    def _by_turns(self, zeta0: Array, guess: Trajectory | None) -> list[DirectSolution]:
        """Return the first solve of each turn from which the value may be least."""
        angles = self.problem.angles

        def solve_from(start: Array) -> DirectSolution:
            near = guess is not None and not angles.turns(guess.states[0] - start).any()
            return self.direct.solve(start, guess=guess if near else None, verify=False)

        return by_turns(self.problem.starts(zeta0), solve_from)

    def _cheapest(self, firsts: list[DirectSolution]) -> tuple[Refined, list[DirectSolution]]:
        """Return the refined cheapest extremal, and the others on aligned meshes."""
        extremals = [
            extremal
            for first in firsts
            for extremal in find_extremals(self.direct, first, starts=self.settings.starts)
        ]
        if self.settings.aligned and len(extremals) > 1:
            known = min(first.value for first in firsts)
            extremals = aligned_extremals(self.direct, extremals, known)
        extremals.sort(key=lambda solution: solution.value)
        best = extremals[0]
        refined = refine(self.direct, self.settings, best.zeta, best.trajectory)
        solution = replace(
            refined.solution,
            iterations=sum(each.iterations for each in (*firsts, refined.solution)),
            seconds=sum(each.seconds for each in (*firsts, refined.solution)),
        )
        return replace(refined, solution=solution), extremals[1:]

    def _saddle_point(self, solution: DirectSolution) -> SaddleSolution | None:
        """Return the cheapest saddle point found; from perturbed states too where the first is dearer.

        It is never started from the direct solution.
        """
        found: list[SaddleSolution] = []
        scale = self.problem.scale
        tolerance = 0.1 * self.settings.value_tolerance * abs(solution.value)
        shifts = 0.05 * scale * np.random.default_rng(1).standard_normal((4, len(scale)))
        for shift in (np.zeros_like(scale), *shifts):
            try:
                start = self._saddle.solve(solution.zeta + shift) if shift.any() else None
                found.append(self._saddle.solve_aligned(solution.zeta, start=start)[0])
            except (RunError, ValueError):
                continue
            if found[-1].value <= solution.value + tolerance:
                break
        return min(found, key=lambda saddle: saddle.value, default=None)

    def _certify(
        self, refined: Refined, others: list[DirectSolution], saddle: SaddleSolution | None
    ) -> Certificate:
        solution, direct = refined.solution, self.direct
        value = max(abs(solution.value), np.finfo(float).tiny)
        path = solution.trajectory
        every = np.ones(len(path.mesh) - 1, dtype=bool)
        fine, long = halved(path.mesh, every), extended(path.mesh, 2.0 * self.horizon)
        finer, longer = (
            direct.solve(solution.zeta, mesh=mesh, degree=path.degree, guess=path, verify=False)
            for mesh in (fine, long)
        )
        refinement = abs(finer.value - solution.value) / value
        integration = abs(solution.reintegrated_value - solution.value) / value
        horizon = abs(longer.value - solution.value) / value
        disagreement = abs(saddle.value - solution.value) / value if saddle else np.inf
        same = 10.0 * self.settings.value_tolerance * value
        return Certificate(
            value_error=refinement + integration + horizon + disagreement,
            defect=solution.defect,
            hji_residual=solution.hji_residual,
            costate_error=self._costate_error(solution, (finer, longer)),
            horizon_error=horizon,
            refinement_error=refinement,
            integration_error=integration,
            disagreement=disagreement,
            second_order=solution.second_order,
            gradient_unique=not any(
                other.second_order and other.value - solution.value <= same for other in others
            ),
        )

    def _costate_error(
        self, solution: DirectSolution, better: tuple[DirectSolution, ...], step: float = 1e-3
    ) -> float:
        """Compare λ'd with (V(ζ + h d) - V(ζ - h d)) / 2h, d a seeded direction in half-widths."""
        scale, path = self.problem.scale, solution.trajectory
        direction = np.random.default_rng(0).standard_normal(len(scale))
        direction *= scale / np.linalg.norm(direction)
        ahead, behind = (
            self.direct.solve(
                solution.zeta + h * direction,
                mesh=path.mesh,
                degree=path.degree,
                guess=path,
                verify=False,
            ).value
            for h in (step, -step)
        )
        difference = (ahead - behind) / (2.0 * step)
        # near the origin, relative to the gradient at the size of the difference step
        least = 1e-3 * float(np.linalg.norm(2.0 * self.problem.P @ scale * scale))
        norm = max(float(np.linalg.norm(solution.costate * scale)), least)
        changes = [np.linalg.norm((other.costate - solution.costate) * scale) for other in better]
        return (abs(float(solution.costate @ direction) - difference) + float(sum(changes))) / norm

    @cached_property
    def _saddle(self) -> SaddleSolver:
        mesh = MeshSettings.saddle.changed(horizon=self.horizon)
        return SaddleSolver(self.problem, mesh.resolving(self.problem.fastest_rate))


def _own(limit: LimitError, work: Work) -> str:
    """Return what a limit of this work says; raises that of another, which this is a part of."""
    if limit.work is not work:
        raise limit
    return str(limit)


def solve(
    problem: Problem, zeta0: ArrayLike, settings: OfflineSettings | None = None
) -> OfflineSolution:
    """Return the certified optimum of a game from one state; see `OfflineSolver` for many."""
    return OfflineSolver(problem, settings).solve(problem.initial_state(zeta0))
