"""The direct solve of the single-player equivalent from a given initial state, on a given mesh.

Collocation and IPOPT, or the structured Newton method on the same discrete problem where the plant is
fully actuated; IPOPT also takes over where Newton's method does not converge.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Unpack

import numpy as np

from ...symbolic import Problem, RunError
from ...symbolic.arrays import Array
from ..path import Domain, Grid, MeshChanges, MeshSettings, Plant, Trajectory, reintegrate, settle
from ..settings import Method
from .derivatives import PointDerivatives
from .guess import LinearStart
from .newton import StructuredNewton
from .stage import single_player
from .transcription import Transcription


@dataclass(frozen=True)
class DirectSolution:
    """What one solve found, and what re-integration says of it.

    Attributes
    ----------
    zeta : (n,) initial state
    value : V(ζ), integral of the local cost with ζ(T)'P ζ(T) as the rest
    costate : (n,) gradient of V at ζ, the multiplier of the initial condition
    u_control, u_disturbance : (k,) optimal policies (8)(9) at ζ
    trajectory : the collocated trajectory
    defect : largest gap between collocated and re-integrated mesh states, in half-widths
    reintegrated_value : the value along the re-integrated trajectory
    hji_residual : |H| of (7) at ζ with the costate, relative to ζ'Qζ
    second_order : whether the reduced Hessian is positive definite, a strict local minimum
    curvature : (K, d, k) accelerations that do not raise the cost to second order, where Newton's
        method found them; else None
    hessian : (n, n) second derivative of V, where Newton's method found it; else None
    method : "newton" or "ipopt", what solved it
    iterations : all rounds of mesh alignment together
    seconds : wall time of solver and starting guess, likewise
    """

    zeta: Array
    value: float
    costate: Array
    u_control: Array
    u_disturbance: Array
    trajectory: Trajectory
    defect: float
    reintegrated_value: float
    hji_residual: float
    second_order: bool
    curvature: Array | None
    hessian: Array | None
    method: Method
    iterations: int
    seconds: float


class DirectSolver:
    """Solve the single-player equivalent of a game from many initial states.

    Parameters
    ----------
    problem : the game on its plant
    settings : of the mesh and its Radau points
    method : "newton" where the plant has inverse dynamics, otherwise and as a safety net IPOPT; or
        "ipopt" always
    changes : single settings of the mesh
    """

    def __init__(
        self,
        problem: Problem,
        settings: MeshSettings = MeshSettings.direct,
        *,
        method: Method = "newton",
        **changes: Unpack[MeshChanges],
    ) -> None:
        self.problem = problem
        self.plant = Plant(problem)
        self.domain = Domain(problem.zeta, problem.domain)
        settings = settings.changed(**changes)
        self.mesh, self.degree = settings.points, settings.degree
        usable = method == "newton" and problem.inverse_dynamics is not None
        self._newton = StructuredNewton(problem) if usable else None
        self._start = LinearStart(problem)
        self._derivatives = PointDerivatives(single_player(problem))
        self._programs: dict[tuple[int, int], Transcription] = {}

    def solve(
        self,
        zeta0: Array,
        *,
        mesh: Array | None = None,
        degree: int | None = None,
        guess: Trajectory | None = None,
        verify: bool = True,
        safety_net: bool = True,
    ) -> DirectSolution:
        """Return the optimum from `zeta0`, started from `guess` or the linear H-infinity policy.

        `mesh` and `degree` replace the solver's own. Without `verify` the trajectory is not
        re-integrated, and defect and reintegrated_value are NaN; without `safety_net` IPOPT does not
        take over from Newton's method.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        RunError
            If the last method tried does not converge, or its trajectory leaves the domain.
        """
        zeta0 = self.problem.require_state(zeta0)
        mesh = self.mesh if mesh is None else mesh
        degree = self.degree if degree is None else degree
        started = time.perf_counter()
        found = None
        if self._newton is not None:
            own = mesh is self.mesh and degree == self.degree
            grid = self._own_grid if own else Grid(mesh, degree, self.problem.n_inputs)
            try:
                found = self._by_newton(self._newton, zeta0, grid, guess)
            except RunError:
                if not safety_net:
                    raise
        if found is None:
            found = self._by_ipopt(zeta0, mesh, degree, guess)
        found = replace(found, seconds=time.perf_counter() - started)
        return self.verified(found) if verify else found

    def solve_aligned(
        self,
        zeta0: Array,
        *,
        mesh: Array | None = None,
        degree: int | None = None,
        guess: Trajectory | None = None,
        verify: bool = True,
        safety_net: bool = True,
        tolerance: float = 1e-6,
        rounds: int = 6,
    ) -> tuple[DirectSolution, Array]:
        """Return the optimum on a mesh with points at its sign changes, and their times.

        They are those of the switching functions along its own trajectory. The mesh is settled on them
        to `tolerance` [s] in as many `rounds` at most; see `settle`.
        Arguments and errors otherwise as of `solve`.
        """

        def solve_on(mesh: Array, guess: Trajectory | None) -> DirectSolution:
            return self.solve(
                zeta0, mesh=mesh, degree=degree, guess=guess, verify=False, safety_net=safety_net
            )

        base = self.mesh if mesh is None else mesh
        solutions, events = settle(
            self.plant,
            base,
            solve_on(base, guess),
            lambda solution: solution.trajectory,
            lambda mesh, solution: solve_on(mesh, solution.trajectory),
            tolerance=tolerance,
            rounds=rounds,
        )
        solution = replace(
            solutions[-1],
            iterations=sum(each.iterations for each in solutions),
            seconds=sum(each.seconds for each in solutions),
        )
        return (self.verified(solution) if verify else solution), events

    def verified(self, solution: DirectSolution) -> DirectSolution:
        """Return the solution with its defect and its value by re-integration."""
        defect, value = reintegrate(self.plant, solution.zeta, solution.trajectory)
        return replace(solution, defect=defect, reintegrated_value=value)

    def beside(self, solution: DirectSolution, size: float) -> Trajectory | None:
        """Return a guess off a point with a conjugate point, along its curvature; None without one.

        `size` is the largest change of a state, in half-widths; its sign chooses the side.
        """
        if solution.curvature is None:
            return None
        path = solution.trajectory
        grid = Grid(path.mesh, path.degree, self.problem.n_inputs)
        bend = grid.trajectory(np.zeros_like(solution.zeta), solution.curvature)
        bend = bend * size / np.abs(bend / self.problem.scale).max()
        return replace(path, states=path.states + bend)

    def _by_newton(
        self, newton: StructuredNewton, zeta0: Array, grid: Grid, guess: Trajectory | None
    ) -> DirectSolution:
        if guess is None:
            start = newton.linear_guess(zeta0, grid)
        else:
            start = guess.accelerations(grid.times).reshape(grid.K, grid.degree, grid.k)
        found = newton.solve(zeta0, grid, start)
        times = np.append(grid.mesh[0], grid.times)
        path = Trajectory(grid.mesh, times, found.states, found.v, grid.degree)
        return self._solution(
            path,
            value=found.value,
            costate=found.costate,
            second_order=found.curvature is None,
            curvature=found.curvature,
            hessian=found.hessian,
            method="newton",
            iterations=found.iterations,
        )

    def _by_ipopt(
        self, zeta0: Array, mesh: Array, degree: int, guess: Trajectory | None
    ) -> DirectSolution:
        program = self._program(len(mesh) - 1, degree)
        times = program.times(mesh)
        first = self._start.sample(zeta0, times)[:2] if guess is None else guess.sample(times)
        found = program.solve(zeta0, mesh, *first)
        # IPOPT adds to the Hessian whenever the inertia is not that of a strict minimum
        added = program.solver.stats()["iterations"]["regularization_size"]
        return self._solution(
            found.path,
            value=found.cost,
            costate=-found.multipliers[: self.problem.n_states],
            second_order=not added or added[-1] == 0.0,
            curvature=None,
            hessian=None,
            method="ipopt",
            iterations=found.iterations,
        )

    @cached_property
    def _own_grid(self) -> Grid:
        return Grid(self.mesh, self.degree, self.problem.n_inputs)

    def _program(self, n_intervals: int, degree: int) -> Transcription:
        key = (n_intervals, degree)
        if key not in self._programs:
            self._programs[key] = Transcription(
                self._derivatives.stage, n_intervals, degree, derivatives=self._derivatives
            )
        return self._programs[key]

    def _solution(
        self,
        path: Trajectory,
        *,
        value: float,
        costate: Array,
        second_order: bool,
        curvature: Array | None,
        hessian: Array | None,
        method: Method,
        iterations: int,
    ) -> DirectSolution:
        self.domain.require(path.times, path.states)
        game, zeta0 = self.problem.game, path.states[0]
        f, g = self.plant.terms(zeta0)
        u_control, u_disturbance = game.policies(g, costate)
        state_cost = max(float(zeta0 @ game.Q @ zeta0), np.finfo(float).tiny)
        return DirectSolution(
            zeta=zeta0,
            value=value,
            costate=costate,
            u_control=u_control,
            u_disturbance=u_disturbance,
            trajectory=path,
            defect=np.nan,
            reintegrated_value=np.nan,
            hji_residual=abs(game.stationary_hamiltonian(zeta0, f, g, costate)) / state_cost,
            second_order=second_order,
            curvature=curvature,
            hessian=hessian,
            method=method,
            iterations=iterations,
            seconds=np.nan,
        )
