"""Legendre-Gauss-Radau collocation of one player's problem as a nonlinear program.

    minimise  Σ_i h_i Σ_j b_j L(X_ij, w_ij, p_ij) + ζ(T)'E ζ(T)
    subject to  Σ_l c_lj X_il = h_i F(X_ij, w_ij, p_ij),   ζ(0) = ζ_0

with F, L and E of a `Stage`, on intervals of length h_i with d Radau points, the last of which is the
interval's end. The degree d rule integrates polynomials of degree 2d - 2 exactly (Kameswaran and
Biegler 2008; Garg et al. 2010). One interval's function is expanded to scalar operations and mapped
over the mesh; the lengths h_i are parameters, so a mesh of as many intervals reuses the program.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np
import scipy.sparse
from casadi import DM, MX, SX

from ...symbolic import RunError
from ...symbolic.arrays import Array
from ..limits import LimitError, Reached
from ..path import Trajectory, radau_rule
from .derivatives import Layout, PointDerivatives, exact_derivatives
from .monitor import Monitor
from .stage import Stage

IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-10,
    "constr_viol_tol": 1e-10,
    "acceptable_iter": 0,
    "mu_init": 1e-9,
    # the multipliers and states of neighbouring points couple like a chain: minimum degree suits it,
    # and neither scaling nor a permutation to the diagonal pays (measured: a fifth less time)
    "mumps_pivot_order": 0,
    "mumps_scaling": 0,
    "mumps_permuting_scaling": 0,
}


@dataclass(frozen=True)
class Optimum:
    """A point that IPOPT converged to.

    Attributes
    ----------
    cost : what is minimised
    path : the collocated trajectory; its input is the stage's w
    multipliers : of ζ(0) - ζ_0 (n,) and the defects (n K d,)
    arguments : parameters of the program
    iterations : of IPOPT
    """

    cost: float
    path: Trajectory
    multipliers: Array
    arguments: Array
    iterations: int


class Transcription:
    """The nonlinear program for a stage on a mesh of K intervals of degree d.

    Build once, solve from many initial states.

    Parameters
    ----------
    derivatives : of the stage, shared by all meshes; made here if None
    patience : IPOPT's limit on its iterations
    """

    def __init__(
        self,
        stage: Stage,
        n_intervals: int,
        degree: int,
        *,
        derivatives: PointDerivatives | None = None,
        patience: int = 200,
    ) -> None:
        self.stage = stage
        self.derivatives = PointDerivatives(stage) if derivatives is None else derivatives
        self.patience = patience
        self.n_intervals = n_intervals
        self.rule = radau_rule(degree)
        self.n_points = n_intervals * degree

    def solve(
        self,
        zeta0: Array,
        mesh: Array,
        states: Array,
        inputs: Array,
        parameters: Array | None = None,
    ) -> Optimum:
        """Return a local minimum near a guess of `states` (K d, n) and `inputs` (K d, k).

        Parameters
        ----------
        parameters : (K d, q) p at the collocation points, if the stage has any

        Raises
        ------
        RunError
            If IPOPT does not converge; the message holds its status.
        LimitError
            If the limits of the solve are reached; with the last iterate.
        """
        given = [zeta0, np.diff(mesh)]
        given += [] if parameters is None else [parameters.ravel()]
        arguments = np.concatenate(given)
        solver, first = self.solver, self.pack(zeta0, states, inputs)
        try:
            with self._monitor.watching():
                answer = solver(x0=first, p=arguments, lbg=0.0, ubg=0.0)
        except LimitError as limit:
            reached, w = self.unpack(np.array(answer["x"]).ravel())
            times = np.append(mesh[0], self.times(mesh))
            limit.reached = Reached(times, reached, w, float(answer["f"]))
            raise
        statistics = solver.stats()
        if not statistics["success"]:
            raise RunError(
                f"IPOPT stopped with '{statistics['return_status']}' after "
                f"{statistics['iter_count']} iterations from {np.array2string(zeta0, precision=3)}"
            )
        found, w = self.unpack(np.array(answer["x"]).ravel())
        return Optimum(
            cost=float(answer["f"]),
            path=Trajectory(mesh, np.append(mesh[0], self.times(mesh)), found, w, self.rule.degree),
            multipliers=np.array(answer["lam_g"]).ravel(),
            arguments=arguments,
            iterations=int(statistics["iter_count"]),
        )

    @cached_property
    def solver(self) -> casadi.Function:
        """IPOPT on the program; parameters are ζ_0 (n,), h (K,) and p (K d, q)."""
        stage, K, d = self.stage, self.n_intervals, self.rule.degree
        n, k, q = (int(symbol.shape[0]) for symbol in (stage.zeta, stage.w, stage.parameters))
        start, zeta0 = MX.sym("start", n), MX.sym("zeta0", n)
        states = MX.sym("states", n, self.n_points)
        inputs = MX.sym("inputs", k, self.n_points)
        parameters = MX.sym("parameters", q, self.n_points)
        lengths = MX.sym("lengths", K)
        ends = states[:, d - 1 :: d]
        starts = casadi.horzcat(start, ends[:, :-1]) if K > 1 else start
        mapped = self._interval().map(K, "serial") if K > 1 else self._interval()
        blocks = [casadi.reshape(x, x.shape[0] * d, K) for x in (states, inputs, parameters)]
        cost, defects = mapped(starts, *blocks, lengths.T)
        final = ends[:, -1]
        program = {
            "x": casadi.veccat(start, states, inputs),
            "p": casadi.veccat(zeta0, lengths, parameters),
            "f": casadi.sum2(cost) + final.T @ DM(stage.terminal) @ final,
            "g": casadi.veccat(start - zeta0, defects),
        }
        layout = Layout(stage, self.rule, K)
        options = {
            "print_time": False,
            **exact_derivatives(layout, self.derivatives, program),
            "iteration_callback": self._monitor,
            "ipopt": IPOPT | {"max_iter": self.patience},
        }
        return casadi.nlpsol("direct", "ipopt", program, options)  # type: ignore[arg-type]

    @cached_property
    def _monitor(self) -> Monitor:
        layout, q = Layout(self.stage, self.rule, self.n_intervals), int(self.stage.parameters.shape[0])
        n_parameters = layout.n + self.n_intervals + q * self.n_points
        return Monitor(layout.n_unknowns, layout.n_constraints, n_parameters)

    def curvature(self, optimum: Optimum) -> tuple[scipy.sparse.csc_matrix, scipy.sparse.csc_matrix]:
        """Return the Hessian of the Lagrangian and the Jacobian of the constraints at an optimum."""
        unknowns = self.pack(optimum.path.states[0], optimum.path.states[1:], optimum.path.v)
        upper = self.solver.get_function("nlp_hess_l")(
            unknowns, optimum.arguments, 1.0, optimum.multipliers
        )
        jacobian = self.solver.get_function("nlp_jac_g")(unknowns, optimum.arguments)[1]
        return casadi.triu2symm(upper).sparse(), jacobian.sparse()

    def pack(self, start: Array, states: Array, inputs: Array) -> Array:
        """Return the unknowns from ζ(0) (n,), states (K d, n) and inputs (K d, k)."""
        return np.concatenate([start, states.ravel(), inputs.ravel()])

    def unpack(self, unknowns: Array) -> tuple[Array, Array]:
        """Return states (K d + 1, n), ζ(0) first, and inputs (K d, k)."""
        n, k = int(self.stage.zeta.shape[0]), int(self.stage.w.shape[0])
        split = n * (self.n_points + 1)
        return unknowns[:split].reshape(-1, n), unknowns[split:].reshape(-1, k)

    def times(self, mesh: Array) -> Array:
        """Return the collocation times, shape (K d,) [s]."""
        return np.asarray((mesh[:-1, None] + np.diff(mesh)[:, None] * self.rule.nodes).ravel())

    def _interval(self) -> casadi.Function:
        """Cost and defects of one interval, expanded to scalar operations."""
        stage, d = self.stage, self.rule.degree
        derivative, weights = self.rule.coefficients
        start, h = SX.sym("start", stage.zeta.shape[0]), SX.sym("h")
        states, inputs, parameters = (
            SX.sym(name, symbol.shape[0], d)
            for name, symbol in (("states", stage.zeta), ("inputs", stage.w), ("p", stage.parameters))
        )
        slopes = casadi.horzcat(start, states) @ DM(derivative)
        cost, defects = SX(0), []
        for j in range(d):
            rate, running = stage.point(states[:, j], inputs[:, j], parameters[:, j])
            defects.append(slopes[:, j] - h * rate)
            cost += h * weights[j] * running
        return casadi.Function(
            "interval",
            [start, casadi.vec(states), casadi.vec(inputs), casadi.vec(parameters), h],
            [cost, casadi.vertcat(*defects)],
        )
