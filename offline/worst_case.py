"""The worst disturbance against a control policy, by direct maximisation.

For u_1 = π(ζ) and a level γ the worst-case cost from ζ_0 is

    W(ζ_0) = sup over d, T of  ∫_0^T |z|^2 - γ^2 d'W_d d dt,     |z|^2 = ζ'Qζ + π'R π,

the available storage of the closed loop (van der Schaft 2017, ch. 8): it is finite exactly where the
policy attains the level γ, and never below V*, the value of the game. It is maximised over d(t) on
[0, T] by collocation and IPOPT, with ζ(T)'X ζ(T) as the rest, X from the bounded-real Riccati equation
of the linearised closed loop. Where that has no solution the linearised closed loop does not attain γ:
there are small disturbances that bring it from rest back to rest at a profit, and repeating them costs
any amount. Otherwise the maximiser may still run off in the nonlinear plant, and this is looked for.

The local maximum that is reported is the best of several starts. Mesh points are put where velocities
change sign, scipy integrates the closed loop again under the disturbance that was found, and the
second-order condition is checked.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from casadi import SX

from ..symbolic import RunError, require_state
from ..symbolic.vehicle import Array
from .mesh import aligned_mesh, graded_mesh
from .plant import Plant, Policy
from .policy import ControlPolicy
from .response import Guess, Responder, Response, Signal, perturbation, reintegrate_response
from .second_order import SecondOrder
from .stage import against_control
from .trajectory import Trajectory
from .verification import sign_changes


@dataclass(frozen=True)
class WorstCase:
    """What a disturbance can make of a control policy from one state.

    Attributes
    ----------
    zeta : (n,) initial state
    unbounded : why no finite maximum is reported, or None where there is one
    cost : W(ζ); infinite where unbounded, as are the numbers that follow from it
    path : the worst trajectory, its input the disturbance; None where unbounded
    second_order : whether it is a strict local maximum; None where unbounded
    reintegrated : the cost when scipy integrates the closed loop under that disturbance
    reach : largest excursion of a state, in half-widths
    starts : (s,) cost reached from each start, NaN where IPOPT did not converge
    output_energy, disturbance_energy : ∫ |z|^2 dt, the rest included, and ∫ d'W_d d dt
    iterations : of IPOPT, all together
    seconds : wall time
    """

    zeta: Array
    unbounded: str | None
    cost: float
    path: Trajectory | None
    second_order: SecondOrder | None
    reintegrated: float
    reach: float
    starts: Array
    output_energy: float
    disturbance_energy: float
    iterations: int
    seconds: float

    def excess(self, value: float) -> float:
        """Return (W - V) / V for the value V of the game at ζ."""
        return (self.cost - value) / value


class WorstCaseSolver:
    """Worst cases of one policy from many states.

    Parameters
    ----------
    policy : the control policy on the plant of its game
    horizon : T [s]
    n_intervals, degree, grading : of the Radau mesh, as for the direct solver
    starts : perturbed starts, beside no disturbance and the linear worst case
    seed : of the perturbations
    reach : excursion that counts as having run off, in half-widths, or in multiples of the initial
        state where that lies outside
    """

    def __init__(
        self,
        policy: ControlPolicy,
        *,
        horizon: float = 120.0,
        n_intervals: int = 40,
        degree: int = 5,
        grading: float = 5.0,
        starts: int = 2,
        seed: int = 0,
        reach: float = 4.0,
    ) -> None:
        self.policy, self.problem = policy, policy.problem
        self.starts, self.seed, self.reach = starts, seed, reach
        # the graded mesh of twice the horizon keeps its first intervals with log(2) more grading
        more = np.log(2.0) if grading > 0.0 else 0.0
        self._meshes = (
            graded_mesh(horizon, n_intervals, grading),
            graded_mesh(2.0 * horizon, 2 * n_intervals, grading + more),
        )
        self._plant = Plant(self.problem)
        self._level = float(self.problem.game.gamma**2)
        X, n, level = (
            policy.bounded_real(self.problem.game.gamma),
            self.problem.n_states,
            SX.sym("level"),
        )
        self._rest = np.zeros((n, n)) if X is None else X
        self.stage = against_control(self.problem, policy.u_control, level, self._rest, level)
        self._responder = Responder(self.stage, degree)

    def solve(self, zeta0: Array) -> WorstCase:
        """Return the worst case from `zeta0`, or that there is none and why.

        Raises
        ------
        InputError
            If the state is not finite, of the wrong shape or pitched by 90 degrees.
        """
        started = time.perf_counter()
        zeta0 = require_state(zeta0, self.problem.n_states)
        reason = self.policy.excludes(self.problem.game.gamma)
        if reason is None:
            try:
                worst = self._measured(zeta0, self._settled(zeta0))
                return replace(worst, seconds=time.perf_counter() - started)
            except RunError as error:
                reason = f"the disturbance runs off: {error}"
        return unbounded(zeta0, reason, time.perf_counter() - started)

    def attenuation(self, worst: WorstCase, bias: float, *, rounds: int = 20) -> float:
        """Return the L2 gain achieved from ζ_0 with a bias, normally V*(ζ_0) [-].

        The smallest g with ∫ |z|^2 dt <= g^2 ∫ d'W_d d dt + bias for every d, the inequality of van der
        Schaft (2017, ch. 8) from a state that is not at rest. The optimal policy has g = γ with the
        bias V*; another one guarantees less, and g > γ. It is infinite where the policy costs more than
        the bias without any disturbance. The ratio is maximised by Dinkelbach's iteration:
        g^2 = (∫ |z|^2 dt - bias) / ∫ d'W_d d dt at the worst case for the level before.

        Raises
        ------
        RunError
            If there is no worst case, or none with a disturbance, to start from, or it gets lost.
        """
        if worst.path is None or worst.disturbance_energy <= 0.0:
            raise RunError("there is no worst-case disturbance whose attenuation could be measured")
        path, level = worst.path, self._level
        if self._cost(worst.zeta, replace(path, v=np.zeros_like(path.v))) >= bias:
            return np.inf
        energies = worst.output_energy, worst.disturbance_energy
        for _ in range(rounds):
            before, level = level, (energies[0] - bias) / energies[1]
            if abs(level - before) <= 1e-6 * before:  # its convergence is quadratic
                break
            response = self._respond(worst.zeta, path.mesh, [path.sample(path.times[1:])], level)
            path, energies = response.path, self._energies(response, level)
        return float(np.sqrt(level))

    def _settled(self, zeta0: Array) -> Response:
        """Return the maximum on a horizon that is long enough."""
        short = self._maximise(zeta0, self._meshes[0])
        if self._tail(short) <= 1e-6:
            return short
        response = self._maximise(zeta0, self._meshes[1])
        growth = response.cost / short.cost - 1.0
        if growth > 1e-3:
            raise RunError(f"the cost grows by a part of {growth:.2g} when the horizon is doubled")
        return response

    def _maximise(self, zeta0: Array, mesh: Array, *, rounds: int = 4) -> Response:
        """Return the best maximum, on a mesh aligned with the sign changes of the velocities."""
        response = self._respond(zeta0, mesh, self._guesses(zeta0, mesh), self._level)
        starts, iterations, known = response.starts, response.iterations, np.empty(0)
        for _ in range(rounds):
            events = sign_changes(self._plant, response.path)
            if len(events) == len(known) and np.abs(events - known).max(initial=0.0) <= 1e-6:
                break
            known, points = events, aligned_mesh(mesh, events)
            guess = response.path.sample(self._responder.times(points))
            response = self._respond(zeta0, points, [guess], self._level)
            iterations += response.iterations
        return replace(response, starts=starts, iterations=iterations)

    def _respond(self, zeta0: Array, mesh: Array, guesses: Iterable[Guess], level: float) -> Response:
        """Return the best maximum from the guesses, on this mesh; refuse one that has run off."""
        points = len(self._responder.times(mesh))
        response = self._responder.best(zeta0, mesh, guesses, np.full((points, 1), level))
        reach, first = (
            float(np.abs(states / self.problem.scale).max()) for states in (response.path.states, zeta0)
        )
        if reach > self.reach * max(1.0, first):
            raise RunError(f"a state reaches {reach:.3g} half-widths of the envelope")
        return response

    def _guesses(self, zeta0: Array, mesh: Array) -> Iterator[Guess]:
        """Yield simulations without disturbance, with the linear worst case, and with random ones.

        Raises
        ------
        RunError
            If the policy loses the plant without a disturbance.
        """
        game, (_, B) = self.problem.game, self.problem.linearization
        worst = game.disturbance_inverse @ B.T @ self._rest
        energy = zeta0 @ self._rest @ zeta0 / (self._level * np.diag(game.W_d))
        rng = np.random.default_rng(self.seed)
        pushes = [perturbation(rng, 0.5 * np.sqrt(energy)) for _ in range(self.starts)]
        yield self._simulated(zeta0, mesh, lambda t, zeta: np.zeros(self.problem.n_inputs))
        for policy in (lambda t, zeta: worst @ zeta, *(_open_loop(push) for push in pushes)):
            try:
                yield self._simulated(zeta0, mesh, policy)
            except RunError:
                continue  # pushed too far

    def _simulated(self, zeta0: Array, mesh: Array, policy: Policy) -> Guess:
        times, level = self._responder.times(mesh), np.array([self._level])
        return self._responder.rollout(zeta0, times, policy, lambda t: level)

    def _measured(self, zeta0: Array, response: Response) -> WorstCase:
        path = response.path
        output, disturbance = self._energies(response, self._level)
        return WorstCase(
            zeta=zeta0,
            unbounded=None,
            cost=-response.cost,
            path=path,
            second_order=response.second_order,
            reintegrated=self._cost(zeta0, path),
            reach=float(np.abs(path.states / self.problem.scale).max()),
            starts=-response.starts,
            output_energy=output,
            disturbance_energy=disturbance,
            iterations=response.iterations,
            seconds=0.0,
        )

    def _cost(self, zeta0: Array, path: Trajectory) -> float:
        """Return the cost when scipy integrates the closed loop under the input of a path."""
        rows = reintegrate_response(self.stage, zeta0, path, np.array([self._level]))
        end = rows[-1, :-1]
        return float(end @ self._rest @ end - rows[-1, -1])

    def _tail(self, response: Response) -> float:
        """Return the part of the cost that is ζ(T)'X ζ(T)."""
        end = response.path.states[-1]
        return float(end @ self._rest @ end) / max(-response.cost, np.finfo(float).tiny)

    def _energies(self, response: Response, level: float) -> tuple[float, float]:
        """Return ∫ |z|^2 dt with the rest, and ∫ d'W_d d dt."""
        path, W_d = response.path, self.problem.game.W_d
        disturbance = float(path.quadrature(np.sum(path.v @ W_d * path.v, axis=1))[-1])
        return level * disturbance - response.cost, disturbance


def unbounded(zeta0: Array, reason: str, seconds: float) -> WorstCase:
    """Return that no finite worst case is known from a state."""
    return WorstCase(
        zeta=zeta0,
        unbounded=reason,
        cost=np.inf,
        path=None,
        second_order=None,
        reintegrated=np.inf,
        reach=np.inf,
        starts=np.empty(0),
        output_energy=np.inf,
        disturbance_energy=np.inf,
        iterations=0,
        seconds=seconds,
    )


def _open_loop(signal: Signal) -> Policy:
    return lambda t, zeta: signal(t)
