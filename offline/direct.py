"""The direct solve: collocation and IPOPT from a given initial state, checked by re-integration."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from ..symbolic import Problem, RunError, require_state
from ..symbolic.vehicle import Array
from .mesh import aligned_mesh, graded_mesh
from .plant import Plant
from .trajectory import Trajectory
from .transcription import Transcription
from .verification import reintegrate, sign_changes


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
    iterations : of IPOPT, all rounds of mesh alignment together
    seconds : wall time of IPOPT and its starting guess, likewise
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
    iterations: int
    seconds: float


class DirectSolver:
    """Solve the single-player equivalent of a game from many initial states.

    Parameters
    ----------
    problem : the game on its plant
    horizon : T [s]; after it the cost is ζ(T)'P ζ(T)
    n_intervals : K
    degree : d, Radau points an interval
    grading : about the logarithm of the ratio of the last to the first interval
    """

    def __init__(
        self,
        problem: Problem,
        *,
        horizon: float = 120.0,
        n_intervals: int = 40,
        degree: int = 5,
        grading: float = 5.0,
    ) -> None:
        self.problem = problem
        self.degree = degree
        self.plant = Plant(problem)
        self.mesh = graded_mesh(horizon, n_intervals, grading)
        self._programs: dict[int, Transcription] = {}

    def solve(
        self,
        zeta0: Array,
        *,
        mesh: Array | None = None,
        guess: Trajectory | None = None,
        verify: bool = True,
    ) -> DirectSolution:
        """Return the optimum from `zeta0`, started from `guess` or the linear H-infinity policy.

        Without `verify` the trajectory is not re-integrated, and defect and reintegrated_value are NaN.

        Raises
        ------
        InputError
            If the state is not finite, of the wrong shape or pitched by 90 degrees.
        RunError
            If IPOPT does not converge; the message holds its status.
        """
        zeta0 = require_state(zeta0, self.problem.n_states)
        mesh = self.mesh if mesh is None else mesh
        started = time.perf_counter()
        program = self._program(len(mesh) - 1)
        times = program.times(mesh)
        first = self._linear_guess(program, zeta0, times) if guess is None else guess.sample(times)
        answer = program.solver(
            x0=program.pack(zeta0, *first),
            p=np.concatenate([zeta0, np.diff(mesh)]),
            lbg=0.0,
            ubg=0.0,
        )
        statistics = program.solver.stats()
        if not statistics["success"]:
            raise RunError(
                f"IPOPT stopped with '{statistics['return_status']}' after "
                f"{statistics['iter_count']} iterations from {np.array2string(zeta0, precision=3)}"
            )
        states, v = program.unpack(np.array(answer["x"]).ravel())
        path = Trajectory(mesh, np.append(mesh[0], times), states, v, self.degree)
        costate = -np.array(answer["lam_g"]).ravel()[: self.problem.n_states]
        seconds = time.perf_counter() - started
        iterations = int(statistics["iter_count"])
        return self._checked(zeta0, float(answer["f"]), costate, path, iterations, seconds, verify)

    def solve_aligned(
        self, zeta0: Array, *, tolerance: float = 1e-6, rounds: int = 6
    ) -> tuple[DirectSolution, Array]:
        """Return the optimum on a mesh with points where the velocities change sign, and their times.

        Drag |ν|ν is only C^1 there, which limits collocation to low order. Solve, locate the sign
        changes, put mesh points on them, and repeat until they move by less than `tolerance` [s].
        """
        solution = self.solve(zeta0, verify=False)
        iterations, seconds = solution.iterations, solution.seconds
        known = np.empty(0)
        for _ in range(rounds):
            events = sign_changes(self.plant, solution.trajectory)
            if len(events) == len(known) and np.abs(events - known).max(initial=0.0) <= tolerance:
                break
            known = events
            mesh = aligned_mesh(self.mesh, events)
            solution = self.solve(zeta0, mesh=mesh, guess=solution.trajectory, verify=False)
            iterations += solution.iterations
            seconds += solution.seconds
        defect, value = reintegrate(self.plant, zeta0, solution.trajectory)
        checked = replace(
            solution,
            defect=defect,
            reintegrated_value=value,
            iterations=iterations,
            seconds=seconds,
        )
        return checked, known

    def _linear_guess(self, program: Transcription, zeta0: Array, times: Array) -> tuple[Array, Array]:
        """Simulate the linear H-infinity policy; beyond a failure, decay to rest."""
        policy = self.plant.linear_policy
        grid = np.append(0.0, times)
        try:
            states, _ = self.plant.simulate(
                zeta0, lambda t, zeta: policy(zeta), grid, tolerance=1e-6, restart=False
            )
        except RunError:
            states = zeta0 * np.exp(-grid)[:, None]
        return states[1:], np.array([policy(state) for state in states[1:]])

    def _program(self, n_intervals: int) -> Transcription:
        if n_intervals not in self._programs:
            self._programs[n_intervals] = Transcription(self.problem, n_intervals, self.degree)
        return self._programs[n_intervals]

    def _checked(
        self,
        zeta0: Array,
        value: float,
        costate: Array,
        path: Trajectory,
        iterations: int,
        seconds: float,
        verify: bool,
    ) -> DirectSolution:
        defect, reintegrated = reintegrate(self.plant, zeta0, path) if verify else (np.nan, np.nan)
        game = self.problem.game
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
            defect=defect,
            reintegrated_value=reintegrated,
            hji_residual=abs(game.stationary_hamiltonian(zeta0, f, g, costate)) / state_cost,
            iterations=iterations,
            seconds=seconds,
        )
