"""One player's best response: local optima from several starts, each with its second-order verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from ...symbolic import RunError
from ...symbolic.arrays import Array
from ...symbolic.integration import integrate
from ..direct import Optimum, PointDerivatives, SecondOrder, Stage, Transcription, second_order
from ..limits import check
from ..path import Trajectory

Guess = tuple[Array, Array]
"""States (K d, n) and inputs (K d, k) at the collocation points."""
Signal = Callable[[float], Array]


@dataclass(frozen=True)
class Response:
    """The best of the local optima that were found.

    Attributes
    ----------
    cost : what the player minimises
    path : trajectory; its input is the player's
    second_order : whether it is a strict local minimum
    starts : (s,) cost reached from each start, NaN where IPOPT did not converge inside the domain
    iterations : of IPOPT, all starts together
    """

    cost: float
    path: Trajectory
    second_order: SecondOrder
    starts: Array
    iterations: int


class Responder:
    """Solves one stage on meshes of any size; the programs are built once a size.

    Parameters
    ----------
    degree : of the Radau collocation
    patience : IPOPT's limit on its iterations
    derivatives : of the stage, shared with others; made here if None
    """

    def __init__(
        self,
        stage: Stage,
        degree: int,
        *,
        patience: int = 80,
        derivatives: PointDerivatives | None = None,
    ) -> None:
        self.stage = stage
        self.degree = degree
        self.patience = patience
        self.derivatives = PointDerivatives(stage) if derivatives is None else derivatives
        self._programs: dict[int, Transcription] = {}

    def program(self, mesh: Array) -> Transcription:
        """Return the program for a mesh."""
        K = len(mesh) - 1
        if K not in self._programs:
            self._programs[K] = Transcription(
                self.stage, K, self.degree, derivatives=self.derivatives, patience=self.patience
            )
        return self._programs[K]

    def times(self, mesh: Array) -> Array:
        """Return the collocation times of a mesh, shape (K d,) [s]."""
        return self.program(mesh).times(mesh)

    def best(
        self, zeta0: Array, mesh: Array, guesses: Iterable[Guess], parameters: Array | None = None
    ) -> Response:
        """Return the best local minimum from the guesses.

        Raises
        ------
        RunError
            If IPOPT converges inside the domain from none of them; the message says why the last did
            not.
        """
        program, found, costs = self.program(mesh), list[Optimum](), list[float]()
        failure: RunError | None = None
        for states, inputs in guesses:
            try:
                optimum = program.solve(zeta0, mesh, states, inputs, parameters)
                self.stage.inside.require(optimum.path.times, optimum.path.states)
                found.append(optimum)
                costs.append(optimum.cost)
            except RunError as error:
                failure = error
                costs.append(np.nan)
        if not found:
            raise RunError("there is no start to respond from") if failure is None else failure
        best = min(found, key=lambda optimum: optimum.cost)
        return Response(
            cost=best.cost,
            path=best.path,
            second_order=second_order(program, best),
            starts=np.array(costs),
            iterations=sum(optimum.iterations for optimum in found),
        )

    def rollout(
        self,
        zeta0: Array,
        times: Array,
        policy: Callable[[float, Array], Array],
        parameters: Signal,
        *,
        tolerance: float = 1e-6,
    ) -> Guess:
        """Integrate the stage under a policy of its player by scipy, from t = 0.

        Returns
        -------
        states and inputs at `times`

        Raises
        ------
        RunError
            If the integration fails: the plant is lost.
        """

        def rhs(t: float, zeta: Array) -> Array:
            return self.stage.kernel(zeta, policy(t, zeta), parameters(t))[0]

        # from rest the input sets the scale
        atol = tolerance * (float(np.abs(zeta0).max()) or 1.0)
        states = integrate(rhs, zeta0, np.append(0.0, times), rtol=tolerance, atol=atol)
        return states, np.array([policy(t, zeta) for t, zeta in zip(times, states, strict=True)])


def perturbation(rng: np.random.Generator, unit: Array, *, decay: float = 5.0) -> Signal:
    """Return a random input: in each channel an oscillation that dies away over `decay` [s].

    Amplitudes are normal with standard deviation `unit` (k,), frequencies up to 0.3 Hz.
    """
    amplitude = unit * rng.standard_normal(len(unit))
    omega = 2.0 * np.pi * rng.uniform(0.0, 0.3, len(unit))
    phase = rng.uniform(0.0, 2.0 * np.pi, len(unit))
    return lambda t: amplitude * np.exp(-t / decay) * np.cos(omega * t + phase)


def reintegrate_response(stage: Stage, zeta0: Array, path: Trajectory, parameters: Array) -> Array:
    """Integrate a stage under the interpolated input of a path, by scipy.

    The integration starts anew at every mesh point: the input is smooth only between them.

    Parameters
    ----------
    parameters : (K, q) constant on each interval

    Returns
    -------
    (K + 1, n + 1) states and the integral of L at the mesh points

    Raises
    ------
    RunError
        If the integration fails.
    """
    rows = [np.append(zeta0, 0.0)]
    atol = 1e-12 * np.append(np.abs(path.states).max() * np.ones(len(zeta0)), 1.0)
    for i, span in enumerate(pairwise(path.mesh)):
        check()
        rhs = _open_loop(stage, path.input_polynomial(i), parameters[i])
        rows.append(integrate(rhs, rows[-1], np.array(span), rtol=1e-10, atol=atol)[-1])
    return np.array(rows)


def _open_loop(
    stage: Stage, w: BarycentricInterpolator, parameters: Array
) -> Callable[[float, Array], Array]:
    def rhs(t: float, y: Array) -> Array:
        rate, running = stage.kernel(y[:-1], w(t), parameters)
        return np.append(rate, running)

    return rhs
