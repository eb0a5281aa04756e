"""The plant's part of Pontryagin's equations with its derivatives, compiled, at many points.

    rate = f + g u,   pull = ∂(λ'rate)/∂ζ,   push = g'λ,   u = u_1 + u_2

No weight of the game is in it, so one compiled function serves every Q, R, W_d and γ of a plant.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX

from ...symbolic import Problem
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function, export


@dataclass(frozen=True)
class FieldTerms:
    """The field at points of any arrangement, `...` below.

    Attributes
    ----------
    rate : (..., n) f + g u
    pull : (..., n) gradient of λ'rate in ζ
    push : (..., k) g'λ
    rate_zeta : (..., n, n) Jacobian of the rate
    g : (..., n, k)
    pull_zeta : (..., n, n) Hessian of λ'rate
    push_zeta : (..., k, n) Jacobian of g'λ
    """

    rate: Array
    pull: Array
    push: Array
    rate_zeta: Array
    g: Array
    pull_zeta: Array
    push_zeta: Array


class ExtremalField:
    """The field of a problem's plant.

    Parameters
    ----------
    problem : its game plays no part
    compiled : False uses CasADi's virtual machine even where a C compiler exists
    """

    def __init__(self, problem: Problem, *, compiled: bool = True) -> None:
        zeta, g = problem.zeta, problem.input_matrix
        costate, u = SX.sym("costate", problem.n_states), SX.sym("u", problem.n_inputs)
        rate, push = problem.drift + g @ u, g.T @ costate
        pull = casadi.gradient(casadi.dot(costate, rate), zeta)
        outputs = {
            "rate": rate,
            "pull": pull,
            "push": push,
            "rate_zeta": casadi.jacobian(rate, zeta),
            "g": g,
            "pull_zeta": casadi.jacobian(pull, zeta),
            "push_zeta": casadi.jacobian(push, zeta),
        }
        self._shapes = [expression.shape for expression in outputs.values()]
        inputs = {"zeta": zeta, "costate": costate, "u": u}
        function = dense_function("extremal_field", inputs, outputs)
        self._kernel, _ = export(function, compiled=compiled)

    def __call__(self, states: Array, costates: Array, u: Array) -> FieldTerms:
        """Return the field at states and costates (..., n) and inputs u_1 + u_2 (..., k)."""
        around, n, kernel = states.shape[:-1], states.shape[-1], self._kernel
        rows = (states.reshape(-1, n), costates.reshape(-1, n), u.reshape(-1, u.shape[-1]))
        found = [np.empty((len(rows[0]), *output.shape)) for output in kernel.outputs]
        for i, arguments in enumerate(zip(*rows, strict=True)):
            for array, value in zip(kernel.inputs, arguments, strict=True):
                array[...] = value
            kernel.evaluate()
            for results, output in zip(found, kernel.outputs, strict=True):
                results[i] = output
        vectors = [
            results.reshape(*around, *(shape if i > 2 else shape[:1]))
            for i, (results, shape) in enumerate(zip(found, self._shapes, strict=True))
        ]
        return FieldTerms(*vectors)
