"""The L2 gain of a policy from rest, measured: the worst disturbance of a given energy.

    g(E)^2 = max over d of  ∫_0^T |z|^2 dt / E    with  ∫_0^T d'W_d d dt = E,   ζ(0) = 0

and |z|^2 = ζ'Qζ + u_1'R u_1. Any disturbance bounds the L2 gain of the nonlinear closed loop (van der
Schaft 2017, ch. 8) from below; for E -> 0 and T -> ∞ the largest tends to the H-infinity norm of the
linearised closed loop, `ControlPolicy.l2_gain`. It is approached by the power iteration of Tierno,
Murray, Doyle and Gregory (J. Guidance, Control and Dynamics 20(6), 1997): with λ the adjoint of the
output's energy along the present trajectory, g'λ its gradient in d, the next disturbance is W_d^-1 g'λ
scaled to the energy. On a linear plant this is the power method for the largest singular value.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np
from casadi import DM, MX, SX

from ...symbolic import InputError, Kernel, RunError
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from ...symbolic.integration import integrate, runge_kutta_step
from ..direct import output_cost
from ..limits import check, count
from ..path import Domain
from .policy import ControlPolicy


@dataclass(frozen=True)
class MeasuredGain:
    """A lower bound of the L2 gain.

    Attributes
    ----------
    energy : E = ∫ d'W_d d dt
    gain : sqrt(∫ |z|^2 dt / E) when scipy integrates the closed loop under the disturbance [-]
    reach : largest excursion of a state, in half-widths
    disturbance : (N, k) held for `step` each
    step : [s]
    iterations : of the power method
    """

    energy: float
    gain: float
    reach: float
    disturbance: Array
    step: float
    iterations: int


class GainMeter:
    """Measures the gain of one policy for disturbances of any energy.

    Parameters
    ----------
    policy : the control policy on the plant of its game, its linearised closed loop stable
    horizon : T [s]
    step : for which a disturbance is held [s]

    Raises
    ------
    InputError
        If the linearised closed loop is not stable.
    """

    def __init__(self, policy: ControlPolicy, *, horizon: float = 60.0, step: float = 0.1) -> None:
        if not policy.stable:
            raise InputError("the L2 gain is infinite: the linearised closed loop is not stable")
        self.policy = policy
        self.problem = policy.problem
        self.step = step
        self.n_steps = int(np.ceil(horizon / step))

    def measure(self, energy: float, *, tolerance: float = 1e-5, limit: int = 200) -> MeasuredGain:
        """Return the largest gain that was found for disturbances of an energy.

        The power method starts from the linearised closed loop's worst harmonic, faded in and out, and
        ends when the gain moves by less than `tolerance`, or at its `limit`.

        Raises
        ------
        InputError
            If the energy is not positive.
        RunError
            If the closed loop is lost, or leaves the domain, under a disturbance of this energy.
        """
        if not energy > 0.0:
            raise InputError(f"the energy of a disturbance must be positive, not {energy:g}")
        best = disturbance = self._scaled(self._harmonic(), energy)
        gains = [0.0]
        while len(gains) <= limit:
            count()
            gradient, output = self._adjoint(disturbance)
            if not np.all(np.isfinite(gradient)):
                raise RunError(f"the closed loop is lost under a disturbance of energy {energy:g}")
            gain = float(np.sqrt(output / energy))
            if gain > max(gains):
                best = disturbance
            gains.append(gain)
            if abs(gain - gains[-2]) <= tolerance * gain:
                break
            disturbance = self._scaled(gradient @ self._weight_inverse, energy)
        gain, reach = self._reintegrated(best, energy)
        return MeasuredGain(energy, gain, reach, best, self.step, len(gains) - 1)

    def _harmonic(self) -> Array:
        omega, direction = self.policy.worst_harmonic()
        t = (np.arange(self.n_steps) + 0.5) * self.step
        fade = np.sin(np.pi * t / (self.n_steps * self.step))
        return np.asarray((np.exp(1j * omega * t) * fade)[:, None] * direction).real

    def _scaled(self, disturbance: Array, energy: float) -> Array:
        W_d = self.problem.game.W_d
        present = self.step * float(np.sum(disturbance @ W_d * disturbance))
        return np.asarray(disturbance * np.sqrt(energy / present))

    def _adjoint(self, disturbance: Array) -> tuple[Array, float]:
        """Return the gradient of the output's energy in the disturbance (N, k), and that energy."""
        gradient, output = self._sweep(disturbance.T)
        return gradient.reshape(self.problem.n_inputs, -1).T, float(output[0])

    @cached_property
    def _weight_inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self.problem.game.W_d))

    @cached_property
    def _sweep(self) -> Kernel:
        """Fourth-order Runge-Kutta steps from rest, and their exact adjoint."""
        problem, h = self.problem, self.step
        d, field = SX.sym("d", problem.n_inputs), self._field
        start = SX.sym("y", problem.n_states + 1)
        end = runge_kutta_step(lambda y: field(y, d), start, h)
        step = casadi.Function("step", [start, d], [end])
        inputs = MX.sym("disturbance", problem.n_inputs, self.n_steps)
        path = step.mapaccum("path", self.n_steps)(DM.zeros(problem.n_states + 1), inputs)
        output = path[-1, -1]
        gradient = casadi.densify(casadi.gradient(output, inputs))
        return Kernel(casadi.Function("sweep", [inputs], [gradient, output]))

    @cached_property
    def _field(self) -> casadi.Function:
        """Rates of ζ and of the output's energy, from both stacked and d."""
        problem, u = self.problem, self.policy.u_control
        d = SX.sym("d", problem.n_inputs)
        rate = problem.drift + problem.input_matrix @ (u + d)
        y = casadi.vertcat(problem.zeta, SX.sym("energy"))
        rates = {"rates": casadi.vertcat(rate, output_cost(problem, u))}
        return dense_function("field", {"y": y, "d": d}, rates)

    def _reintegrated(self, disturbance: Array, energy: float) -> tuple[float, float]:
        """Return gain and reach when scipy integrates the closed loop; it must stay in the domain."""
        kernel, rows = Kernel(self._field), [np.zeros(self.problem.n_states + 1)]
        span = np.array([0.0, self.step])

        def rhs(t: float, y: Array) -> Array:
            kernel.inputs[0][...] = y
            kernel.evaluate()
            return kernel.outputs[0].copy()

        atol = 1e-10 * np.sqrt(energy)
        for d in disturbance:
            check()
            kernel.inputs[1][...] = d
            rows.append(integrate(rhs, rows[-1], span, rtol=1e-8, atol=atol)[-1])
        states, problem = np.array(rows)[:, :-1], self.problem
        times = np.asarray(self.step * np.arange(len(states)), dtype=np.float64)
        Domain(problem.zeta, problem.domain).require(times, states)
        return float(np.sqrt(rows[-1][-1] / energy)), float(np.abs(states / problem.scale).max())
