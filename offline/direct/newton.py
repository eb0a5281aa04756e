"""A structured Newton method for fully actuated plants: the input is eliminated.

With ζ = (η, η_dot) and inverse dynamics v(ζ, a), a = η_ddot, the single-player equivalent is a problem
of the calculus of variations without constraints,

    minimise over a(t)   ∫ L(ζ, a) dt + ζ(T)'P ζ(T),     L = ζ'Qζ + v(ζ, a)'R_eff v(ζ, a),

and the kinematics are linear. On an interval of length h with d Radau points and A of Radau IIA,

    η_dot_j = η_dot_0 + h Σ_l A_jl a_l,     η_j = η_0 + h c_j η_dot_0 + h^2 Σ_l (A^2)_jl a_l,

which is the collocation of `transcription` to the letter, with the accelerations as only unknowns. A
Newton step is a linear-quadratic problem with K stages, solved by one backward Riccati pass and one
forward pass (Dunn and Bertsekas 1989). Besides the step the backward pass yields the gradient of V at
ζ_0, its Hessian, and the second-order condition: every stage's block is positive definite exactly if
the reduced Hessian of the whole problem is, that is if no conjugate point lies inside the horizon.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np
from casadi import DM, SX

from ...symbolic import InputError, Problem, RunError
from ...symbolic.arrays import Array
from ...symbolic.compiled import BatchKernel, dense_function
from ..limits import LimitError, Reached, count
from ..path import ConjugatePoint, Grid, RiccatiPass, adjoint, backward
from .guess import LinearStart


@dataclass(frozen=True)
class NewtonResult:
    """A stationary point of the discretised problem.

    Attributes
    ----------
    value : V(ζ_0)
    costate : (n,) its gradient
    hessian : (n, n) its second derivative; None at a point that is not a strict local minimum
    accelerations : (K, d, k)
    states : (K d + 1, n), ζ_0 first
    v : (K d, k)
    curvature : (K, d, k) accelerations along which the cost does not rise to second order: the point
        has a conjugate point and is not a strict local minimum; None where it is one
    iterations : Newton steps
    """

    value: float
    costate: Array
    hessian: Array | None
    accelerations: Array
    states: Array
    v: Array
    curvature: Array | None
    iterations: int


@dataclass(frozen=True)
class _Model:
    """Second-order model of the cost around a trajectory."""

    value: float
    accelerations: Array
    points: Array
    states: Array
    v: Array
    end: Array
    gradient: Array
    hessian: Array


class StructuredNewton:
    """Newton's method on one problem, for any mesh and initial state.

    Raises
    ------
    InputError
        If the problem has no inverse dynamics.
    """

    def __init__(self, problem: Problem, *, compiled: bool = True) -> None:
        if problem.inverse_dynamics is None:
            raise InputError(
                f"{problem.name}: the structured Newton method needs a fully actuated plant with its "
                "inverse dynamics; use IPOPT"
            )
        self.problem, self._inverse = problem, problem.inverse_dynamics
        self._compiled = compiled
        self._start = LinearStart(problem, compiled=compiled)

    def solve(
        self,
        zeta0: Array,
        grid: Grid,
        accelerations: Array,
        *,
        tolerance: float = 1e-10,
        max_iterations: int = 60,
    ) -> NewtonResult:
        """Return the stationary point that Newton's method finds from a guess of the accelerations.

        Steps are shortened so that the cost falls.

        Parameters
        ----------
        accelerations : (K, d, k) guess
        tolerance : ends when the decrease that the model still promises is below tolerance^2 of the
            cost, so that the trajectory is right to about this relative error

        Raises
        ------
        RunError
            If that is not reached.
        LimitError
            If the limits of the solve are reached; with the last trajectory.
        """
        current = self._model(zeta0, grid, accelerations)
        for iteration in range(1, max_iterations + 1):
            self._count(grid, current)
            found = self._step(grid, current)
            trial = self._search(zeta0, grid, current, found.forward(grid), found.promised)
            small = found.promised <= tolerance**2 * current.value
            if trial is None and not small and found.promised > 1e-12 * current.value:
                break
            if trial is None or small:
                lower = current if trial is None or trial.value > current.value else trial
                return self._result(grid, lower, iteration)
            current = trial
        raise RunError(
            f"Newton's method did not converge in {iteration} iterations from "
            f"{np.array2string(zeta0, precision=3)}"
        )

    def _count(self, grid: Grid, current: _Model) -> None:
        """Count an iteration; a limit that is reached comes with the present trajectory."""
        try:
            count()
        except LimitError as limit:
            times = np.append(grid.mesh[0], grid.times)
            limit.reached = Reached(times, current.states, current.v, current.value)
            raise

    def linear_guess(self, zeta0: Array, grid: Grid) -> Array:
        """Return the accelerations (K, d, k) of the plant under the linear H-infinity policy."""
        _, _, rate = self._start.sample(zeta0, grid.times)
        return rate[:, grid.k :].reshape(grid.K, grid.degree, grid.k)

    @cached_property
    def _point(self) -> BatchKernel:
        """L with gradient (3 k,) and Hessian (3 k, 3 k) in (η, η_dot, a), and v."""
        point, L, v = self._cost()
        hessian, gradient = casadi.hessian(L, point)
        outputs = {"cost": L, "gradient": gradient, "hessian": hessian, "v": v}
        return BatchKernel(
            dense_function("newton_point", {"point": point}, outputs), compiled=self._compiled
        )

    @cached_property
    def _convex_point(self) -> BatchKernel:
        """The Gauss-Newton part of that Hessian, 2 Q and 2 v_z'R_eff v_z: positive semidefinite."""
        point, _, v = self._cost()
        sensitivity = casadi.jacobian(v, point)
        own = 2 * sensitivity.T @ DM(self.problem.game.R_eff) @ sensitivity
        k = self.problem.n_inputs
        state = casadi.diagcat(SX(DM(2 * self.problem.game.Q)), SX(k, k))
        return BatchKernel(
            dense_function("newton_convex", {"point": point}, {"hessian": own + state}),
            compiled=self._compiled,
        )

    def _cost(self) -> tuple[SX, SX, SX]:
        """Return the symbol (η, η_dot, a), and L and v of it."""
        problem, inverse = self.problem, self._inverse
        zeta, a, v = problem.zeta, inverse.acceleration, inverse.v
        L = zeta.T @ DM(problem.game.Q) @ zeta + v.T @ DM(problem.game.R_eff) @ v
        point = SX.sym("point", 3 * problem.n_inputs)
        L, v = casadi.substitute([L, v], [casadi.vertcat(zeta, a)], [point])
        return point, L, v

    def _model(self, zeta0: Array, grid: Grid, accelerations: Array) -> _Model:
        stages = grid.stages(zeta0, accelerations)
        points = grid.points(stages)
        cost, gradient, hessian, v = self._point(points)
        end = grid.flow[-1] @ stages[-1].ravel()
        value = float(grid.weights.ravel() @ cost[:, 0] + end @ self.problem.P @ end)
        return _Model(
            value=value,
            accelerations=accelerations,
            points=points,
            states=np.vstack([zeta0, points[:, : 2 * grid.k]]),
            v=v,
            end=end,
            gradient=grid.condense_gradient(gradient),
            hessian=grid.condense(hessian),
        )

    def _step(self, grid: Grid, model: _Model) -> RiccatiPass:
        """Return Newton's step, or where the model is not convex one between it and Gauss-Newton's."""
        found = self._backward(grid, model, model.hessian)
        if isinstance(found, RiccatiPass):
            return found
        (flat,) = self._convex_point(model.points)
        convex = grid.condense(flat)
        for part in (0.5, 0.0):
            blend = convex + part * (model.hessian - convex)
            found = self._backward(grid, model, blend)
            if isinstance(found, RiccatiPass):
                return found
        raise RunError("the Gauss-Newton model of the cost is not convex; Q and R_eff must be")

    def _backward(self, grid: Grid, model: _Model, hessian: Array) -> RiccatiPass | ConjugatePoint:
        P = 2.0 * self.problem.P
        return backward(grid, hessian, model.gradient, P, P @ model.end, self._inertia)

    @cached_property
    def _inertia(self) -> Array:
        """Second derivative of v'R_eff v in the acceleration at rest, (k, k)."""
        _, B = self.problem.linearization
        inverse = np.linalg.inv(B[self.problem.n_inputs :])
        return np.asarray(2.0 * inverse.T @ self.problem.game.R_eff @ inverse)

    def _search(
        self, zeta0: Array, grid: Grid, current: _Model, step: Array, promised: float
    ) -> _Model | None:
        """Return the model along the step where the cost has fallen enough, or None."""
        length, rounding = 1.0, 1e-14 * abs(current.value)
        while length > 1e-6:
            trial = self._model(zeta0, grid, current.accelerations + length * step)
            if trial.value <= current.value - 0.1 * length * promised + rounding:
                return trial
            length /= 2.0
        return None

    def _result(self, grid: Grid, model: _Model, iterations: int) -> NewtonResult:
        found = self._backward(grid, model, model.hessian)
        if isinstance(found, RiccatiPass):
            costate, hessian, curvature = found.p, found.P, None
        else:
            costate = adjoint(grid, model.gradient, 2.0 * self.problem.P @ model.end)
            hessian, curvature = None, found.curvature(grid)
        return NewtonResult(
            value=model.value,
            costate=costate,
            hessian=hessian,
            accelerations=model.accelerations,
            states=model.states,
            v=model.v,
            curvature=curvature,
            iterations=iterations,
        )
