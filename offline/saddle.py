"""The saddle point itself: Pontryagin's state-costate boundary value problem, both players unknown.

    ζ_dot = f + g (u_1 + u_2),   λ_dot = -∂H/∂ζ,   ∂H/∂u_1 = 0,   ∂H/∂u_2 = 0,
    ζ(0) = ζ_0,   λ(T) = 2 P ζ(T), the stable manifold of the linearised game,

with H = ζ'Qζ + u_1'R u_1 - γ^2 u_2'W_d u_2 + λ'(f + g (u_1 + u_2)) of (6). Unknowns at every Radau
point are ζ, λ, u_1 and u_2. Nothing is minimised and R_eff is not used: this solution shares neither
unknowns nor derivatives of the model with the direct one, so their disagreement is evidence. A sparse
Newton method solves the square system, started from the linearised game and, where that does not
converge, by continuation in the initial state.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
import scipy.linalg
import scipy.sparse.linalg
from casadi import DM, MX, SX

from ..symbolic import Problem, RunError, require_state
from ..symbolic.vehicle import Array
from .mesh import graded_mesh
from .radau import RadauRule


@dataclass(frozen=True)
class SaddleSolution:
    """The saddle point from one state.

    Attributes
    ----------
    zeta : (n,) initial state
    value : integral of r of (5), with ζ(T)'P ζ(T) as the rest
    costate : (n,) λ(0), the gradient of V
    u_control, u_disturbance : (K d, k) both players at the Radau points
    times : (K d + 1,) [s], 0 first
    states, costates : (K d + 1, n)
    iterations : Newton steps, those of all continuation steps together
    """

    zeta: Array
    value: float
    costate: Array
    u_control: Array
    u_disturbance: Array
    times: Array
    states: Array
    costates: Array
    iterations: int


class SaddleSolver:
    """Solve the boundary value problem of a game from many states.

    Parameters
    ----------
    problem : the game on its plant, γ finite
    horizon : T [s]
    n_intervals, degree, grading : of the Radau mesh, as for the direct solver
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
        self.rule = RadauRule(degree)
        self.mesh = graded_mesh(horizon, n_intervals, grading)
        self._systems: dict[int, casadi.Function] = {}

    def solve(self, zeta0: Array, *, mesh: Array | None = None) -> SaddleSolution:
        """Return the saddle point from `zeta0`, on `mesh` if it is given.

        Raises
        ------
        InputError
            If the state is not finite, of the wrong shape or pitched by 90 degrees.
        RunError
            If continuation in the initial state needs steps below a thousandth.
        """
        zeta0 = require_state(zeta0, self.problem.n_states)
        mesh = self.mesh if mesh is None else mesh
        unknowns = self._linear_start(zeta0, mesh)
        reached, step, iterations = 0.0, 1.0, 0
        while reached < 1.0:
            part = min(1.0, reached + step)
            guess = unknowns * (part / reached if reached > 0.0 else part)
            found, count = self._newton(guess, part * zeta0, mesh)
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
        return self._unpack(unknowns, zeta0, mesh, iterations)

    def _newton(
        self, unknowns: Array, zeta0: Array, mesh: Array, limit: int = 20
    ) -> tuple[Array | None, int]:
        """Return the root, or None where Newton's method does not converge, and its iterations."""
        system = self._system(len(mesh) - 1)
        for iteration in range(1, limit + 1):
            residual, matrix = system(unknowns, zeta0, np.diff(mesh))
            try:
                factors = scipy.sparse.linalg.splu(matrix.sparse())
            except (RuntimeError, ValueError):  # singular, or not finite
                return None, iteration
            step = factors.solve(-np.array(residual).ravel())
            unknowns = unknowns + step
            size = np.abs(unknowns).max()
            if not np.isfinite(size) or size > 1e9:
                return None, iteration
            if np.abs(step).max() < 1e-11 * max(1.0, size):
                return unknowns, iteration
        return None, limit

    def _system(self, n_intervals: int) -> casadi.Function:
        """Residual and its Jacobian as functions of unknowns, ζ_0 and interval lengths."""
        if n_intervals not in self._systems:
            n, d, width = self.problem.n_states, self.rule.degree, self._width
            first = MX.sym("first", 2 * n)
            points = MX.sym("points", width, n_intervals * d)
            zeta0, lengths = MX.sym("zeta0", n), MX.sym("lengths", n_intervals)
            ends = points[: 2 * n, d - 1 :: d]
            starts = casadi.horzcat(first, ends[:, :-1])
            blocks = casadi.reshape(points, width * d, n_intervals)
            interval = self._interval()
            mapped = interval.map(n_intervals) if n_intervals > 1 else interval
            defects = mapped(starts, blocks, lengths.T)
            last = ends[:, -1]
            manifold = last[n:] - 2 * DM(self.problem.P) @ last[:n]
            residual = casadi.vertcat(first[:n] - zeta0, casadi.vec(defects), manifold)
            unknowns = casadi.veccat(first, points)
            self._systems[n_intervals] = casadi.Function(
                "saddle",
                [unknowns, zeta0, lengths],
                [residual, casadi.jacobian(residual, unknowns)],
            )
        return self._systems[n_intervals]

    @property
    def _width(self) -> int:
        return 2 * self.problem.n_states + 2 * self.problem.n_inputs

    def _interval(self) -> casadi.Function:
        """Collocation defects and stationarity of both players on one interval."""
        n, d = self.problem.n_states, self.rule.degree
        derivative, _ = self.rule.coefficients
        field = self._field()
        start, h = SX.sym("start", 2 * n), SX.sym("h")
        points = SX.sym("points", self._width, d)
        slopes = casadi.horzcat(start, points[: 2 * n, :]) @ DM(derivative)
        rows = []
        for j in range(d):
            rate, stationarity = field(points[:, j])
            rows += [slopes[:, j] - h * rate, stationarity]
        return casadi.Function("interval", [start, casadi.vec(points), h], [casadi.vertcat(*rows)])

    def _field(self) -> casadi.Function:
        """(ζ_dot, λ_dot) and (∂H/∂u_1, ∂H/∂u_2) at one point."""
        problem, game = self.problem, self.problem.game
        zeta, costate = problem.zeta, SX.sym("costate", problem.n_states)
        u_1, u_2 = (SX.sym(name, problem.n_inputs) for name in ("u_control", "u_disturbance"))
        rate = problem.drift + problem.input_matrix @ (u_1 + u_2)
        cost = zeta.T @ DM(game.Q) @ zeta + u_1.T @ DM(game.R) @ u_1
        cost -= game.gamma**2 * u_2.T @ DM(game.W_d) @ u_2
        hamiltonian = cost + costate.T @ rate
        players = [casadi.gradient(hamiltonian, u) for u in (u_1, u_2)]
        flow = casadi.vertcat(rate, -casadi.gradient(hamiltonian, zeta))
        point = casadi.vertcat(zeta, costate, u_1, u_2)
        return casadi.Function("field", [point], [flow, casadi.vertcat(*players)])

    def _linear_start(self, zeta0: Array, mesh: Array) -> Array:
        """Return the unknowns of the linearised game: ζ(t) of its closed loop, λ = 2 P ζ."""
        problem, game = self.problem, self.problem.game
        A, B = problem.linearization
        closed = A - B @ game.R_eff_inverse @ B.T @ problem.P
        states = np.array([scipy.linalg.expm(closed * t) @ zeta0 for t in self._times(mesh)])
        costates = 2.0 * states @ problem.P
        push = costates @ B
        u_1, u_2 = -0.5 * push @ game.R_inverse, 0.5 * push @ game.disturbance_inverse
        points = np.hstack([states, costates, u_1, u_2])[1:]
        return np.concatenate([states[0], costates[0], points.ravel()])

    def _times(self, mesh: Array) -> Array:
        inner = mesh[:-1, None] + np.diff(mesh)[:, None] * self.rule.nodes
        return np.append(mesh[0], inner.ravel())

    def _unpack(self, unknowns: Array, zeta0: Array, mesh: Array, iterations: int) -> SaddleSolution:
        problem, n, k = self.problem, self.problem.n_states, self.problem.n_inputs
        points = unknowns[2 * n :].reshape(-1, self._width)
        states = np.vstack([unknowns[:n], points[:, :n]])
        costates = np.vstack([unknowns[n : 2 * n], points[:, n : 2 * n]])
        u_1, u_2 = points[:, 2 * n : 2 * n + k], points[:, 2 * n + k :]
        _, weights = self.rule.coefficients
        local = problem.game.local_cost(states[1:], u_1, u_2).reshape(-1, self.rule.degree)
        rest = float(states[-1] @ problem.P @ states[-1])
        return SaddleSolution(
            zeta=zeta0,
            value=float(np.diff(mesh) @ (local @ weights)) + rest,
            costate=costates[0],
            u_control=u_1,
            u_disturbance=u_2,
            times=self._times(mesh),
            states=states,
            costates=costates,
            iterations=iterations,
        )
