"""Predicted closed-loop trajectories, their cost and its gradient, as compiled functions.

Under the policies (14)(15) of given actor weights the model obeys ζ_dot = F(ζ), with the local cost
r(ζ) = r(ζ, û_1, û_2). One call integrates both over the whole horizon with fixed steps, by a method
that suits the fastest mode (`stepping`), and one more yields the costates

    λ(t) = ∂J(ζ(t)) / ∂ζ,   J(ζ(t)) = ∫_t^T r dτ + ζ(T)'P ζ(T),
    -λ_dot = r_ζ' + F_ζ'λ,   λ(T) = 2 P ζ(T)

as the exact gradient of the discretised cost (reverse mode, one step at a time). -λ_dot = ... is the
gradient of the Bellman equation r + V_ζ F = 0 along the path, so λ is what V_ζ has to be there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np
from casadi import DM, MX, SX

from ..arrays import Array
from ..compiled import Kernel, dense_function
from ..game import Problem
from .basis import Basis
from .stepping import Stepping

BOUND = 4.0  # half-widths; a path that gets farther, or out of the domain, counts as lost
Exporter = Callable[[casadi.Function, int, Sequence[Array]], Kernel]


@dataclass(frozen=True)
class PredictedPath:
    """A predicted trajectory at the ends of its steps.

    Attributes
    ----------
    times : (N + 1,) [s]
    states : (N + 1, n); from where the path left the bound, they stay where they were
    cost_to_go : (N + 1,) J from each of them; infinite when the path left
    costates : (N + 1, n) λ, or None when only the path was asked for
    """

    times: Array
    states: Array
    cost_to_go: Array
    costates: Array | None = None

    @property
    def cost(self) -> float:
        """J of the whole path; infinite when it left."""
        return float(self.cost_to_go[0])


class Prediction:
    """Predict a horizon under given actor weights.

    A policy that is too stiff for the steps makes the path leave the bound: such a policy counts as
    bad, never as good.

    Parameters
    ----------
    problem, basis : of the policies
    stepping : the steps over the horizon, and their method
    exporter : makes a kernel of a function, its number of operations and its last inputs' values
    """

    def __init__(self, problem: Problem, basis: Basis, stepping: Stepping, exporter: Exporter) -> None:
        self.problem = problem
        self.basis = basis
        self.stepping = stepping
        self._exporter = exporter
        self._row_kernels: dict[int, Kernel] = {}

    @property
    def steps(self) -> Array:
        """The steps over the horizon, (N,) [s]."""
        return self.stepping.steps

    def build(self, n_points: Sequence[int]) -> Iterator[str]:
        """Build what a path and its cost need, and yield the names of the functions.

        Parameters
        ----------
        n_points : numbers of points for which rows will be asked; costates and rows only if any
        """
        self._path_kernel  # noqa: B018 - built when first asked for
        yield "predicted_path"
        if self.problem.same_inputs:
            self._linear_kernel  # noqa: B018
            yield "predicted_linear_path"
        if n_points:
            self._costate_kernel  # noqa: B018
            yield "predicted_costates"
            for number in n_points:
                self._row_kernel(number)
            yield "costate_rows"

    def path(self, zeta: Array, actor_1: Array, actor_2: Array) -> PredictedPath:
        """Return the path from ζ (n,) under Ŵ_a1, Ŵ_a2 (m,)."""
        (nodes,) = _called(self._path_kernel, zeta, actor_1, actor_2)
        return self._as_path(nodes)

    def linear_path(self, zeta: Array) -> PredictedPath:
        """Return the path from ζ (n,) under the linear policies u_1 = -K_1 ζ and u_2 = K_2 ζ."""
        (nodes,) = _called(self._linear_kernel, zeta)
        return self._as_path(nodes)

    def costates(self, zeta: Array, actor_1: Array, actor_2: Array) -> PredictedPath:
        """Return the same path with its costates."""
        nodes, costates = _called(self._costate_kernel, zeta, actor_1, actor_2)
        return self._as_path(nodes, costates.T)

    def rows(self, points: Array, costates: Array) -> tuple[Array, Array, Array]:
        """Return L g'σ'^T (N, k, m), L g'λ (N, k) and σ (N, m) at N points, L'L = R_eff^-1 / 4.

        |L g'(σ'^T W - λ)|^2 is what the policy of the weights W costs per second more than the one of
        the value with the gradient λ.
        """
        n_points, k, m = len(points), self.problem.n_inputs, self.basis.n_basis
        kernel = self._row_kernel(n_points)
        kernel.inputs[0].T[...] = points
        kernel.inputs[1].T[...] = costates
        kernel.evaluate()
        regressors, targets, sigma = (output.ravel(order="K") for output in kernel.outputs)
        by_point = regressors.reshape(n_points, m, k).transpose(0, 2, 1)
        return by_point, targets.reshape(n_points, k), sigma.reshape(n_points, m)

    def _as_path(self, nodes: Array, costates: Array | None = None) -> PredictedPath:
        n, P, steps = self.problem.n_states, self.problem.P, self.steps
        states, cost, clock = nodes[:n].T, nodes[n], nodes[n + 1]
        stayed = clock[-1] >= (1.0 - 1e-6) * steps.sum()
        if not stayed:
            to_go = np.full(len(cost), np.inf)
        elif self.stepping.relative:
            to_go = cost[-1] - cost + np.einsum("ti,ij,tj->t", states, P, states)
        else:
            to_go = cost[-1] + float(states[-1] @ P @ states[-1]) - cost
        return PredictedPath(np.append(0.0, np.cumsum(steps)), states, to_go, costates)

    @cached_property
    def _step(self) -> casadi.Function:
        """One step of (ζ, cost, clock) under the policies of given weights."""
        return self._step_of(self._rates)

    def _step_of(self, rates: casadi.Function) -> casadi.Function:
        """Return a step of rates with weights; outside the bound nothing moves any more."""
        n = self.problem.n_states
        y = MX.sym("y", n + 2)
        weights = [MX.sym(rates.name_in(i), *rates.size_in(i)) for i in range(1, rates.n_in())]
        own = self._parameters(1)
        moved = self.stepping.step(lambda at: rates(at, *weights), y, own)
        inside = casadi.mmax(casadi.fabs(moved[:n] / DM(self.problem.scale))) < BOUND
        if self.problem.domain:
            margins = casadi.Function("margins", [self.problem.zeta], [self.problem.margins])
            inside = casadi.logic_and(inside, casadi.mmin(margins(moved[:n])) > 0)
        return casadi.Function("step", [y, *weights, *own], [casadi.if_else(inside, moved, y)])

    @cached_property
    def _rates(self) -> casadi.Function:
        """Rates of (ζ, cost, clock) under the policies (14)(15)."""
        game, m = self.problem.game, self.basis.n_basis
        actors = [SX.sym("actor_1", m), SX.sym("actor_2", m)]
        push_1, push_2 = (
            self.problem.input_matrix.T
            @ casadi.gradient(casadi.dot(weights, self.basis.sigma), self.problem.zeta)
            for weights in actors
        )
        u_1, u_2 = -0.5 * DM(game.R_inverse) @ push_1, 0.5 * DM(game.disturbance_inverse) @ push_2
        return self._rates_under(u_1, u_2, actors)

    def _rates_under(self, u_1: SX, u_2: SX, parameters: list[SX]) -> casadi.Function:
        problem, game = self.problem, self.problem.game
        y = SX.sym("y", problem.n_states + 2)
        cost = casadi.dot(problem.zeta, DM(game.Q) @ problem.zeta) + casadi.dot(u_1, DM(game.R) @ u_1)
        if np.isfinite(game.gamma):
            cost -= game.gamma**2 * casadi.dot(u_2, DM(game.W_d) @ u_2)
        rates = casadi.vertcat(problem.drift + problem.input_matrix @ (u_1 + u_2), cost, 1)
        at_y = casadi.substitute(rates, problem.zeta, y[: problem.n_states])
        names = ["y", *(f"parameter_{i}" for i in range(len(parameters)))]
        return casadi.Function("rates", [y, *parameters], [at_y], names, ["rates"], {"cse": True})

    def _parameters(self, n_steps: int) -> list[MX]:
        """Return symbols of the parameters of so many steps."""
        known = self.stepping.parameters.items()
        columns = [(name, *value.shape) for name, value in known]
        return [
            MX.sym(name, rows, of_all // len(self.steps) * n_steps) for name, rows, of_all in columns
        ]

    def _symbols(self) -> tuple[MX, list[MX], list[MX]]:
        n, m = self.problem.n_states, self.basis.n_basis
        inputs = [MX.sym("zeta", n), MX.sym("actor_1", m), MX.sym("actor_2", m)]
        parameters = self._parameters(len(self.steps))
        return self._nodes(self._step, inputs, parameters), inputs, parameters

    def _nodes(self, step: casadi.Function, inputs: list[MX], parameters: list[MX]) -> MX:
        start, n_steps = casadi.vertcat(inputs[0], MX.zeros(2)), len(self.steps)
        repeated = [casadi.repmat(weights, 1, n_steps) for weights in inputs[1:]]
        return casadi.horzcat(start, step.mapaccum(n_steps)(start, *repeated, *parameters))

    def _exported(
        self, name: str, inputs: list[MX], parameters: list[MX], outputs: dict[str, MX], operations: int
    ) -> Kernel:
        """Return a kernel whose last inputs are the parameters, already written."""
        symbols = [*inputs, *parameters]
        names = [symbol.name() for symbol in symbols]
        function = casadi.Function(name, symbols, [*outputs.values()], names, [*outputs])
        return self._exporter(function, operations, [*self.stepping.parameters.values()])

    @cached_property
    def _path_kernel(self) -> Kernel:
        nodes, inputs, parameters = self._symbols()
        operations = self._operations(self._rates)
        return self._exported("predicted_path", inputs, parameters, {"nodes": nodes}, operations)

    @cached_property
    def _linear_kernel(self) -> Kernel:
        zeta, parameters = MX.sym("zeta", self.problem.n_states), self._parameters(len(self.steps))
        K_1, K_2 = self.problem.linear_gains
        rates = self._rates_under(-DM(K_1) @ self.problem.zeta, DM(K_2) @ self.problem.zeta, [])
        outputs = {"nodes": self._nodes(self._step_of(rates), [zeta], parameters)}
        operations = self._operations(rates)
        return self._exported("predicted_linear_path", [zeta], parameters, outputs, operations)

    @cached_property
    def _costate_kernel(self) -> Kernel:
        n, n_steps = self.problem.n_states, len(self.steps)
        nodes, inputs, parameters = self._symbols()
        y, later = MX.sym("y", n + 2), MX.sym("costate", n + 2)
        weights = [MX.sym("actor_1", self.basis.n_basis), MX.sym("actor_2", self.basis.n_basis)]
        own = self._parameters(1)
        earlier = casadi.jtimes(self._step(y, *weights, *own), y, later, True)
        back = casadi.Function("back", [later, y, *weights, *own], [earlier])
        gradient = 2 * DM(self.problem.P) @ nodes[:n, :]
        at_end = MX.zeros(n) if self.stepping.relative else gradient[:, -1]
        last = casadi.vertcat(at_end, 1, 0)
        repeated = [casadi.repmat(symbol, 1, n_steps) for symbol in inputs[1:]]
        reverse = [
            casadi.horzcat(*casadi.horzsplit(each, each.shape[1] // n_steps)[::-1])
            for each in parameters
        ]
        swept = back.mapaccum(n_steps)(last, nodes[:, -2::-1], *repeated, *reverse)
        costates = casadi.horzcat(swept[:, ::-1], last)[:n, :]
        outputs = {
            "nodes": nodes,
            "costates": costates + gradient if self.stepping.relative else costates,
        }
        operations = 4 * self._operations(self._rates)
        return self._exported("predicted_costates", inputs, parameters, outputs, operations)

    def _operations(self, rates: casadi.Function) -> int:
        return int(4 * len(self.steps) * rates.n_instructions())

    def _row_kernel(self, n_points: int) -> Kernel:
        if n_points not in self._row_kernels:
            self._row_kernels[n_points] = self._rows_of(n_points)
        return self._row_kernels[n_points]

    def _rows_of(self, n_points: int) -> Kernel:
        problem, n = self.problem, self.problem.n_states
        costate = SX.sym("costate", n)
        L = DM(np.linalg.cholesky(problem.game.R_eff_inverse / 4.0).T)
        push = L @ problem.input_matrix.T
        outputs = {
            "regressor": push @ self.basis.jacobian.T,
            "target": push @ costate,
            "sigma": self.basis.sigma,
        }
        point = dense_function("costate_row", {"zeta": problem.zeta, "costate": costate}, outputs)
        points, costates = MX.sym("points", n, n_points), MX.sym("costates", n, n_points)
        mapped = (
            point.map(n_points, "serial")(points, costates) if n_points > 1 else point(points, costates)
        )
        names = ["points", "costates"], ["regressors", "targets", "sigmas"]
        function = casadi.Function("costate_rows", [points, costates], [*mapped], *names)
        return self._exporter(function, point.n_instructions() * n_points, ())


def _called(kernel: Kernel, *arguments: Array) -> tuple[Array, ...]:
    """Return copies of the results for the first arguments; the others are those of before."""
    for array, value in zip(kernel.inputs, arguments, strict=False):
        array[...] = value
    kernel.evaluate()
    return tuple([output.copy("K") for output in kernel.outputs])
