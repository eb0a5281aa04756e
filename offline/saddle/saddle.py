"""The saddle point itself: Pontryagin's state-costate boundary value problem, both players unknown.

Nothing is minimised, and the equations (`boundary.py`) don't know R_eff: this solution shares neither
unknowns nor derivatives of the model nor collocation with the direct one, so their disagreement is
evidence. Newton's method starts at rest, from where its first step is the linearised game, and goes
on by continuation in the initial state where that does not converge; the first Newton step after
each change of ζ_0 is then the Euler predictor along the path of solutions.
"""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np

from ...symbolic import Problem, RunError
from ...symbolic.arrays import Array
from ..limits import count
from ..path import Domain, GaussRule, MeshChanges, MeshSettings, Plant, interpolate, settle
from .boundary import BoundaryProblem, Unknowns
from .extremal_field import ExtremalField


@dataclass(frozen=True)
class SaddleSolution:
    """The saddle point from one state.

    Attributes
    ----------
    zeta : (n,) initial state
    value : integral of r of (5), with ζ(T)'P ζ(T) as the rest
    costate : (n,) λ(0), the gradient of V
    slope : dV/dγ = -2 γ times the integral of u_2'W_d u_2, by the envelope theorem; 0 for infinite γ
    mesh : (K + 1,) interval ends [s]
    times : (K (d + 1) + 1,) mesh and Gauss points [s], ascending
    states, costates : (K (d + 1) + 1, n) there
    u_control, u_disturbance : (K d, k) both players at the Gauss points
    iterations : Newton steps, those of continuation and alignment too
    seconds : wall time, likewise
    """

    zeta: Array
    value: float
    costate: Array
    slope: float
    mesh: Array
    times: Array
    states: Array
    costates: Array
    u_control: Array
    u_disturbance: Array
    iterations: int
    seconds: float

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return states and costates, each (len, n), at times >= 0; rest beyond T."""
        return self._sampled(self._points, times, self.states[:-1], self.costates[:-1])

    def sample_players(self, times: Array) -> tuple[Array, Array]:
        """Return u_1 and u_2, each (len, k), likewise."""
        return self._sampled(self._points[1:], times, self.u_control, self.u_disturbance)

    @property
    def _points(self) -> Array:
        """The start and the Gauss points of an interval, in (0, 1)."""
        n_points = (len(self.times) - 1) // (len(self.mesh) - 1)
        first = self.times[:n_points]
        return np.asarray((first - self.mesh[0]) / (self.mesh[1] - self.mesh[0]))

    def _sampled(self, points: Array, times: Array, first: Array, second: Array) -> tuple[Array, Array]:
        width = first.shape[1]
        both = np.hstack([first, second]).reshape(len(self.mesh) - 1, len(points), 2 * width)
        sampled = interpolate(points, self.mesh, both, times)
        sampled[times > self.mesh[-1]] = 0.0
        return sampled[:, :width], sampled[:, width:]


class SaddleSolver:
    """Solve the boundary value problem of a game from many states.

    Parameters
    ----------
    problem : the game on its plant; γ may be infinite
    settings : of the mesh and its Gauss points; not those of the direct solver
    compiled : False uses CasADi's virtual machine even where a C compiler exists
    changes : single settings of the mesh
    """

    def __init__(
        self,
        problem: Problem,
        settings: MeshSettings = MeshSettings.saddle,
        *,
        compiled: bool = True,
        **changes: Unpack[MeshChanges],
    ) -> None:
        self.problem = problem
        self.settings = settings.changed(**changes)
        self.rule = GaussRule(self.settings.degree)
        self.mesh = self.settings.points
        self.plant = Plant(problem)
        self.domain = Domain(problem.zeta, problem.domain)
        self._field = ExtremalField(problem, compiled=compiled)
        self._boundary = BoundaryProblem(problem, self._field, self.rule)

    def with_gamma(self, gamma: float) -> SaddleSolver:
        """Return the solver of the same problem at another γ; it shares the compiled functions.

        Raises
        ------
        GammaTooSmallError
            If γ does not exceed the threshold of R_eff > 0.
        """
        other = copy.copy(self)
        other.problem = self.problem.with_gamma(gamma)
        other._boundary = BoundaryProblem(other.problem, self._field, self.rule)
        return other

    def with_horizon(self, horizon: float) -> SaddleSolver:
        """Return the solver of the same problem with a longer T [s], its first intervals about kept."""
        other = copy.copy(self)
        other.settings = self.settings.lengthened(horizon)
        other.mesh = other.settings.points
        return other

    def solve(
        self, zeta0: Array, *, mesh: Array | None = None, start: SaddleSolution | None = None
    ) -> SaddleSolution:
        """Return the saddle point from `zeta0`, on `mesh` if it is given, first tried from `start`.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        RunError
            If continuation in the initial state needs steps below a thousandth, or the saddle point's
            trajectory leaves the domain.
        """
        zeta0 = self.problem.require_state(zeta0)
        mesh = self.mesh if mesh is None else mesh
        started, iterations = time.perf_counter(), 0
        unknowns = None
        if start is not None:
            unknowns, iterations = self._newton(self._guess(start, mesh), zeta0, mesh)
        if unknowns is None:
            unknowns, count = self._continued(zeta0, mesh)
            iterations += count
        return self._solution(unknowns, zeta0, mesh, iterations, time.perf_counter() - started)

    def solve_aligned(
        self,
        zeta0: Array,
        *,
        start: SaddleSolution | None = None,
        tolerance: float = 1e-6,
        rounds: int = 6,
    ) -> tuple[SaddleSolution, Array]:
        """Return the saddle point on a mesh with points at its sign changes, and their times.

        They are those of the switching functions along its own trajectory. The mesh is settled on them
        to `tolerance` [s] in as many `rounds` at most; see `settle`. Raises as `solve`.
        """
        solutions, events = settle(
            self.plant,
            self.mesh,
            self.solve(zeta0, start=start),
            lambda solution: solution,
            lambda mesh, solution: self.solve(zeta0, mesh=mesh, start=solution),
            tolerance=tolerance,
            rounds=rounds,
        )
        solution = replace(
            solutions[-1],
            iterations=sum(each.iterations for each in solutions),
            seconds=sum(each.seconds for each in solutions),
        )
        return solution, events

    def _continued(self, zeta0: Array, mesh: Array) -> tuple[Unknowns, int]:
        """Follow the solution from rest to `zeta0`, in one step if it can be."""
        unknowns = self._boundary.at_rest(len(mesh) - 1)
        reached, step, iterations = 0.0, 1.0, 0
        while reached < 1.0:
            part = min(1.0, reached + step)
            found, count = self._newton(unknowns, part * zeta0, mesh)
            iterations += count
            if found is not None:
                unknowns, reached, step = found, part, 2.0 * step
                continue
            step /= 2.0
            if step < 1e-3:
                raise RunError(
                    f"no saddle point was found beyond {reached:.1%} of the way to "
                    f"{np.array2string(zeta0, precision=3)}"
                )
        return unknowns, iterations

    def _newton(
        self, unknowns: Unknowns, zeta0: Array, mesh: Array, limit: int = 20
    ) -> tuple[Unknowns | None, int]:
        """Return the root, or None where Newton's method does not converge, and its iterations."""
        lengths = np.diff(mesh)
        for iteration in range(1, limit + 1):
            count()
            try:
                # a step too far, to where the model is singular, shows in its size
                with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                    step = self._boundary.newton_step(unknowns, zeta0, lengths)
                    unknowns = unknowns.plus(step)
                    size = self._boundary.size(step)
            except np.linalg.LinAlgError:
                return None, iteration
            if not size < 1e3:
                return None, iteration
            if size <= 1e-10 * self._boundary.size(unknowns):
                return unknowns, iteration
        return None, limit

    def _guess(self, start: SaddleSolution, mesh: Array) -> Unknowns:
        """Return the unknowns of another solution on this mesh."""
        K, d = len(mesh) - 1, self.rule.degree
        inner = self.rule.times(mesh).ravel()
        ends, points = (np.hstack(start.sample(times)) for times in (mesh, inner))
        players = (u.reshape(K, d, -1) for u in start.sample_players(inner))
        return Unknowns(ends, points.reshape(K, d, -1), *players)

    def _solution(
        self, unknowns: Unknowns, zeta0: Array, mesh: Array, iterations: int, seconds: float
    ) -> SaddleSolution:
        problem, game, n = self.problem, self.problem.game, self.problem.n_states
        K, d, lengths = len(mesh) - 1, self.rule.degree, np.diff(mesh)
        along = np.concatenate([unknowns.ends[:-1, None], unknowns.points], axis=1)
        path = np.vstack([along.reshape(K * (d + 1), -1), unknowns.ends[-1:]])
        times = np.column_stack([mesh[:-1], self.rule.times(mesh)]).ravel()
        times = np.append(times, mesh[-1])
        self.domain.require(times, path[:, :n])
        u_1, u_2 = unknowns.control, unknowns.disturbance
        local = game.local_cost(unknowns.points[..., :n], u_1, u_2)
        end = unknowns.ends[-1, :n]
        slope = 0.0
        if np.isfinite(game.gamma):
            energy = np.sum((u_2 @ game.W_d) * u_2, axis=-1)
            slope = -2.0 * game.gamma * float(lengths @ (energy @ self.rule.weights))
            slope += float(end @ problem.P_gamma @ end)
        return SaddleSolution(
            zeta=zeta0,
            value=float(lengths @ (local @ self.rule.weights)) + float(end @ problem.P @ end),
            costate=unknowns.ends[0, n:],
            slope=slope,
            mesh=mesh,
            times=times,
            states=path[:, :n],
            costates=path[:, n:],
            u_control=u_1.reshape(K * d, -1),
            u_disturbance=u_2.reshape(K * d, -1),
            iterations=iterations,
            seconds=seconds,
        )
