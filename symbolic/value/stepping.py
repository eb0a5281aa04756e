"""How a prediction goes over its horizon: its steps, and the method that integrates them.

Two methods for ζ_dot = F(ζ) with the cost rate r(ζ) beside it. The classical Runge-Kutta method is the
cheaper one where its longest step times the fastest mode of the closed loop is at most `STABLE`.
A vehicle with strong damping or little inertia has modes of 20 to 200 1/s, and a horizon of half a
minute: there the exponential Runge-Kutta method of order four of Krogstad (2005, J. Comput. Phys. 203)
takes its place. With A = F_ζ(0) under the linear policies and N(ζ) = F(ζ) - A ζ,

    φ_0(z) = e^z,   φ_{k+1}(z) = (φ_k(z) - 1/k!) / z,   φ_k = φ_k(hA),   ψ_k = φ_k(hA/2)
    ζ_2 = ψ_0 ζ + h/2 ψ_1 N(ζ)
    ζ_3 = ψ_0 ζ + h (ψ_1/2 - ψ_2) N(ζ) + h ψ_2 N(ζ_2)
    ζ_4 = φ_0 ζ + h (φ_1 - 2 φ_2) N(ζ) + 2 h φ_2 N(ζ_3)
    ζ_+ = φ_0 ζ + h (φ_1 - 3 φ_2 + 4 φ_3) N(ζ) + h (2 φ_2 - 4 φ_3) (N(ζ_2) + N(ζ_3))
          + h (4 φ_3 - φ_2) N(ζ_4)

which is exact where F is linear, however stiff, and needs no step below a mode's time constant once
that mode has decayed. While it decays the steps follow it: they start at half the time constant of the
fastest mode and grow by half each. The cost is integrated as what it differs from ζ'P ζ by,

    J(ζ) = ζ'P ζ + ∫ e(ζ) dt,   e = r + 2 ζ'P F(ζ),

whose integrand is zero for the linearised game and of third order in ζ otherwise, so that no fast
transient has to be resolved by the quadrature either.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import casadi
import numpy as np
from casadi import DM, MX

from ..arrays import Array
from ..game import Problem
from ..integration import doubled_phi, phi_functions, runge_kutta_step

STABLE = 2.0  # of the longest step times the fastest mode; Runge-Kutta is unstable above 2.8
FIRST, GROWTH = 0.5, 1.5  # of the fastest mode's time constant; of a step to the next

Rate = Callable[[MX], MX]


def growing_steps(horizon: float, n_steps: int, growth: float = 5.0) -> Array:
    """Return N steps that add up to the horizon, the last `growth` times the first, shape (N,) [s].

    The fast modes are damped within a second or two; what is left is slow.
    """
    steps = np.linspace(1.0, growth, n_steps)
    return np.asarray(horizon / steps.sum() * steps)


def graded_steps(horizon: float, n_steps: int, fastest: float) -> Array:
    """Return growing steps with shorter ones before them that resolve the mode of `fastest` [1/s].

    They add up to the horizon, N and a few more [s].
    """
    longest = growing_steps(horizon, n_steps)[0]
    number = max(int(np.ceil(np.log(longest * fastest / FIRST) / np.log(GROWTH))), 0)
    first = FIRST / fastest * GROWTH ** np.arange(number)
    return np.append(first, growing_steps(horizon - first.sum(), n_steps))


class Stepping(Protocol):
    """The steps of a prediction, each from y = (ζ, cost, clock) at its start to y at its end.

    Attributes
    ----------
    steps : (N,) [s]
    parameters : what every step is told, by name, (rows, columns N), the columns of a step side by side
    method : in words
    relative : whether the cost is that beyond ζ'P ζ of the state where it starts, whose end then costs
        nothing; otherwise the end costs ζ'P ζ
    """

    steps: Array
    parameters: dict[str, Array]
    method: str
    relative: bool

    def step(self, rate: Rate, y: MX, parameters: list[MX]) -> MX:
        """Return y (n + 2,) after one step, with its columns of the parameters; rate(y) = (F, r, 1)."""
        ...


class RungeKutta:
    """The classical method of order four, with given steps (N,) [s]."""

    method = "the classical Runge-Kutta method"
    relative = False

    def __init__(self, steps: Array) -> None:
        self.steps = steps
        self.parameters = {"steps": steps[None, :]}

    def step(self, rate: Rate, y: MX, parameters: list[MX]) -> MX:
        """Return y after one step."""
        return runge_kutta_step(rate, y, parameters[0])


class Exponential:
    """Krogstad's exponential method around the linearised closed loop, with given steps (N,) [s]."""

    method = "the exponential Runge-Kutta method"
    relative = True

    def __init__(self, problem: Problem, steps: Array) -> None:
        self.steps = steps
        self._A, self._P = problem.closed_loop, problem.P
        stages = zip(*(stage_matrices(self._A, h) for h in steps), strict=True)
        self.parameters = {"steps": steps[None, :]} | {
            f"stage_{number}": np.hstack(matrices) for number, matrices in enumerate(stages, 2)
        }

    def step(self, rate: Rate, y: MX, parameters: list[MX]) -> MX:
        """Return y after one step; the cost by the weights 1, 2, 2, 1 of the stages over 6."""
        h, stage_2, stage_3, stage_4, end = parameters
        n = len(self._A)
        zeta, A = y[:n], DM(self._A)
        here, e_1 = self._parts(rate, y)
        N_1 = here - A @ zeta
        y_2 = casadi.vertcat(stage_2 @ casadi.vertcat(zeta, N_1), y[n:])
        here, e_2 = self._parts(rate, y_2)
        N_2 = here - A @ y_2[:n]
        y_3 = casadi.vertcat(stage_3 @ casadi.vertcat(zeta, N_1, N_2), y[n:])
        here, e_3 = self._parts(rate, y_3)
        N_3 = here - A @ y_3[:n]
        y_4 = casadi.vertcat(stage_4 @ casadi.vertcat(zeta, N_1, N_3), y[n:])
        here, e_4 = self._parts(rate, y_4)
        N_4 = here - A @ y_4[:n]
        moved = end @ casadi.vertcat(zeta, N_1, N_2 + N_3, N_4)
        cost = y[n] + h / 6 * (e_1 + 2 * e_2 + 2 * e_3 + e_4)
        return casadi.vertcat(moved, cost, y[n + 1] + h)

    def _parts(self, rate: Rate, y: MX) -> tuple[MX, MX]:
        """Return F (n,) and e = r + 2 ζ'P F."""
        n = len(self._A)
        rates = rate(y)
        return rates[:n], rates[n] + 2 * casadi.dot(DM(self._P) @ y[:n], rates[:n])


def stepping_of(problem: Problem, horizon: float, n_steps: int) -> RungeKutta | Exponential:
    """Return the method and the steps that suit the fastest mode of a problem's closed loop.

    n_steps : N of the growing steps, with which Runge-Kutta is used while it is stable
    """
    steps = growing_steps(horizon, n_steps)
    fastest = problem.fastest_rate
    if fastest * steps[-1] <= STABLE:
        return RungeKutta(steps)
    return Exponential(problem, graded_steps(horizon, n_steps, fastest))


def stage_matrices(A: Array, h: float) -> tuple[Array, Array, Array, Array]:
    """Return what ζ and the N of the stages before are multiplied with: of ζ_2, ζ_3, ζ_4 and ζ_+.

    (n, 2n), (n, 3n), (n, 3n) and (n, 4n); A (n, n) in 1/s, h in s.
    """
    half = phi_functions(A * (h / 2.0))
    psi_0, psi_1, psi_2, _ = half
    phi_0, phi_1, phi_2, phi_3 = doubled_phi(half)
    return (
        np.hstack([psi_0, h / 2.0 * psi_1]),
        np.hstack([psi_0, h * (psi_1 / 2.0 - psi_2), h * psi_2]),
        np.hstack([phi_0, h * (phi_1 - 2.0 * phi_2), 2.0 * h * phi_2]),
        np.hstack(
            [
                phi_0,
                h * (phi_1 - 3.0 * phi_2 + 4.0 * phi_3),
                h * (2.0 * phi_2 - 4.0 * phi_3),
                h * (4.0 * phi_3 - phi_2),
            ]
        ),
    )
