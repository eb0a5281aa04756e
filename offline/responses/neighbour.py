"""The neighbouring-optimal feedback along an optimal trajectory of the single-player equivalent.

    v(t, ζ) = v*(t) - K(t) (ζ - ζ*(t)),     K = (2 R_eff)^-1 (H_vζ + g'Π)

with H = ζ'Qζ + v'R_eff v + λ'(f + g v), and the Hessian Π of the value and the costate λ along ζ* from

    -Π_dot = H_ζζ + A'Π + Π A - K'2 R_eff K,          Π(T) = 2 P,     A = ∂(f + g v)/∂ζ,
    -λ_dot = 2 Q ζ + A'λ - K'(g'λ + 2 R_eff v),       λ(T) = 2 P ζ(T)

(the accessory problem; Bryson and Ho 1975, ch. 6). The last bracket is zero on an optimal trajectory;
it makes the backward integration of λ as stable as the closed loop. f is only C^1 where a velocity
changes sign: H_ζζ jumps there and Π does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi
import numpy as np
from casadi import DM, SX
from scipy.interpolate import BarycentricInterpolator

from ...symbolic import Kernel, Problem
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from ...symbolic.integration import integrate
from ..limits import check
from ..path import Trajectory


@dataclass(frozen=True)
class Feedback:
    """v = offset - gain ζ at given times.

    Attributes
    ----------
    times : (N,) [s]
    offset : (N, k), v* + K ζ*
    gain : (N, k, n), K
    """

    times: Array
    offset: Array
    gain: Array

    @cached_property
    def parameters(self) -> Array:
        """Offsets and gains as parameters of a stage, shape (N, k + k n), gains by columns."""
        columns = self.gain.transpose(0, 2, 1).reshape(len(self.times), -1)
        return np.hstack([self.offset, columns])

    def parameters_at(self, t: float) -> Array:
        """Return the parameters at a time, linear between the given ones, shape (k + k n,)."""
        j = int(np.clip(np.searchsorted(self.times, t), 1, len(self.times) - 1))
        before, after = self.times[j - 1 : j + 1]
        part = min(max((t - before) / (after - before), 0.0), 1.0)
        return np.asarray((1.0 - part) * self.parameters[j - 1] + part * self.parameters[j])

    def v(self, t: float, zeta: Array) -> Array:
        """Return v(t, ζ), shape (k,), likewise."""
        parameters, k = self.parameters_at(t), self.offset.shape[1]
        return np.asarray(parameters[:k] - parameters[k:].reshape(-1, k).T @ zeta)


def feedback_law(zeta: SX, n_inputs: int) -> tuple[SX, SX]:
    """Return v = offset - gain ζ as an expression, and its parameters as `Feedback` orders them."""
    n = int(zeta.shape[0])
    parameters = SX.sym("feedback", n_inputs * (n + 1))
    gain = casadi.reshape(parameters[n_inputs:], n_inputs, n)
    return parameters[:n_inputs] - gain @ zeta, parameters


class NeighbouringOptimum:
    """Builds the feedback of a problem along its optimal trajectories."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def along(self, path: Trajectory, times: Array, *, tolerance: float = 1e-8) -> Feedback:
        """Return the feedback at ascending `times` in (0, T] along an optimal `path`.

        `tolerance` is relative, of the integration of Π and λ between mesh points.

        Raises
        ------
        RunError
            If Π has no bounded solution: the trajectory has a conjugate point.
        """
        problem, n = self.problem, self.problem.n_states
        P, final = problem.P, path.states[-1]
        y = np.append(2.0 * P.ravel(), 2.0 * P @ final)
        root = np.sqrt(np.diag(P))
        size = float(np.linalg.norm(root * problem.scale))
        atol = tolerance * 2.0 * np.append(np.outer(root, root), root * size)
        gains = np.empty((len(times), problem.n_inputs, n))
        for i, (left, right) in reversed([*enumerate(pairwise(path.mesh))]):
            check()
            slope = self._along(path.state_polynomial(i), path.input_polynomial(i))
            inside = np.flatnonzero((times > left) & (times <= right))[::-1]
            stops = np.unique(np.concatenate([[left, right], times[inside]]))[::-1]
            # Π rests at 2 P for most of the way, where DOP853 overshoots its stable steps
            rows = integrate(slope, y, stops, rtol=tolerance, atol=atol, method="RK45")
            passed = dict(zip(stops, [y, *rows], strict=True))
            for j in inside:
                zeta, v = path.sample(times[j : j + 1])
                gains[j] = self._slope(passed[times[j]], zeta[0], v[0])[1]
            y = rows[-1]
        nominal, v = path.sample(times)
        return Feedback(times, v + np.einsum("jkn,jn->jk", gains, nominal), gains)

    def _along(
        self, states: BarycentricInterpolator, inputs: BarycentricInterpolator
    ) -> Callable[[float, Array], Array]:
        return lambda t, y: self._slope(y, np.asarray(states(t)), np.asarray(inputs(t)))[0]

    def _slope(self, y: Array, zeta: Array, v: Array) -> tuple[Array, Array]:
        """Return the rates of (Π, λ) and the gain K."""
        problem, n = self.problem, self.problem.n_states
        Pi, costate = y[: n * n].reshape(n, n), y[n * n :]
        Pi = 0.5 * (Pi + Pi.T)  # backwards, an antisymmetric error would grow
        A, g, H_zz, H_vz = self._terms(zeta, v, costate)
        g = g.reshape(n, problem.n_inputs)  # a single input comes out flat
        weight = 2.0 * problem.game.R_eff
        K = 0.5 * problem.game.R_eff_inverse @ (H_vz + g.T @ Pi)
        Pi_dot = -(H_zz + A.T @ Pi + Pi @ A - K.T @ weight @ K)
        excess = g.T @ costate + weight @ v
        costate_dot = -(2.0 * problem.game.Q @ zeta + A.T @ costate - K.T @ excess)
        return np.append(Pi_dot.ravel(), costate_dot), K

    @cached_property
    def _terms(self) -> Kernel:
        """A, g, H_ζζ and H_vζ from ζ, v and λ."""
        problem, zeta = self.problem, self.problem.zeta
        v, costate = SX.sym("v", problem.n_inputs), SX.sym("costate", problem.n_states)
        rate = problem.drift + problem.input_matrix @ v
        curvature, _ = casadi.hessian(casadi.dot(costate, rate), zeta)
        outputs = {
            "A": casadi.jacobian(rate, zeta),
            "g": problem.input_matrix,
            "H_zz": curvature + 2 * DM(problem.game.Q),
            "H_vz": casadi.jacobian(problem.input_matrix.T @ costate, zeta),
        }
        inputs = {"zeta": zeta, "v": v, "costate": costate}
        return Kernel(dense_function("accessory", inputs, outputs))
