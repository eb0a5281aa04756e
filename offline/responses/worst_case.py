"""The worst disturbance against a control policy, by direct maximisation.

For u_1 = π(ζ) and a level γ the worst-case cost from ζ_0 is

    W(ζ_0) = sup over d, T of  ∫_0^T |z|^2 - γ^2 d'W_d d dt,     |z|^2 = ζ'Qζ + π'R π,

the available storage of the closed loop (van der Schaft 2017, ch. 8): it is finite exactly where the
policy attains the level γ, and never below V*, the value of the game. It is maximised over d(t) on
[0, T] by collocation and IPOPT, with ζ(T)'X ζ(T) as the rest, X from the bounded-real Riccati equation
of the linearised closed loop. Where that has no solution the linearised closed loop does not attain γ:
there are small disturbances that bring it from rest back to rest at a profit, and repeating them costs
any amount. Otherwise the maximiser may still run off in the nonlinear plant, and this is looked for.

The local maximum that is reported is the best of several starts. Mesh points are put where switching
functions change sign, scipy integrates the closed loop again under the disturbance that was found, and
the second-order condition is checked.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np
from casadi import SX
from numpy.typing import ArrayLike

from ...symbolic import Problem, RunError
from ...symbolic.arrays import Array
from ..direct import SecondOrder, against_control
from ..limits import EndedByLimitError, Limits, limited
from ..path import MeshChanges, MeshSettings, Trajectory
from .disturber import ByInterval, Disturber
from .policy import ControlPolicy, linear_policy
from .response import Response


@dataclass(frozen=True)
class WorstCase:
    """What a disturbance can make of a control policy from one state.

    Attributes
    ----------
    zeta : (n,) initial state
    unbounded : why no finite maximum is reported, or None where there is one
    ended : whether that is because the limits of the solve were reached
    cost : W(ζ); infinite where unbounded, as are the numbers that follow from it
    path : the worst trajectory, its input the disturbance; None where unbounded
    second_order : whether it is a strict local maximum; None where unbounded
    reintegrated : the cost when scipy integrates the closed loop under that disturbance
    reach : largest excursion of a state, in half-widths
    starts : (s,) cost reached from each start, NaN where IPOPT did not converge inside the domain
    output_energy, disturbance_energy : ∫ |z|^2 dt, the rest included, and ∫ d'W_d d dt
    iterations : of IPOPT, all together
    seconds : wall time
    """

    zeta: Array
    unbounded: str | None
    ended: bool
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
    settings : of the mesh and its Radau points; None for those of the direct solver, suited to the
        closed loop
    starts : perturbed starts, beside no disturbance and the linear worst case
    seed : of the perturbations
    reach : excursion that counts as having run off, in half-widths, or in multiples of the initial
        state where that lies outside
    limits : of one solve
    changes : single settings of the mesh
    """

    def __init__(
        self,
        policy: ControlPolicy,
        settings: MeshSettings | None = None,
        *,
        starts: int = 2,
        seed: int = 0,
        reach: float = 4.0,
        limits: Limits | None = None,
        **changes: Unpack[MeshChanges],
    ) -> None:
        self.policy, self.problem = policy, policy.problem
        self.limits = Limits() if limits is None else limits
        suited = MeshSettings.direct.suited(self.problem) if settings is None else settings
        short = suited.changed(**changes)
        # the graded mesh of twice the horizon keeps its first intervals with log(2) more grading
        long = MeshSettings(
            horizon=2.0 * short.horizon,
            n_intervals=2 * short.n_intervals,
            degree=short.degree,
            grading=short.grading + (np.log(2.0) if short.grading > 0.0 else 0.0),
        )
        self._meshes = short.points, long.points
        self._level = float(self.problem.game.gamma**2)
        X, n = policy.bounded_real(self.problem.game.gamma), self.problem.n_states
        level, rest = SX.sym("level"), np.zeros((n, n)) if X is None else X
        stage = against_control(self.problem, policy.u_control, level, rest, level)
        self._disturber = Disturber(
            self.problem, stage, short.degree, starts=starts, seed=seed, reach=reach
        )

    def solve(self, zeta0: Array) -> WorstCase:
        """Return the worst case from `zeta0`, or that there is none and why.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        """
        started = time.perf_counter()
        zeta0 = self.problem.require_state(zeta0)
        reason, ended = self.policy.excludes(self.problem.game.gamma), False
        if reason is None:
            try:
                with limited(self.limits):
                    response = self._settled(zeta0)
                    return measured(self._disturber, zeta0, response, _constant(self._level), started)
            except EndedByLimitError as error:
                reason, ended = f"no worst case was found: {error}", True
            except RunError as error:
                reason = f"the disturbance runs off: {error}"
        return unbounded(zeta0, reason, time.perf_counter() - started, ended=ended)

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
        undisturbed = replace(path, v=np.zeros_like(path.v))
        if self._disturber.cost(worst.zeta, undisturbed, _constant(level)) >= bias:
            return np.inf
        energies = worst.output_energy, worst.disturbance_energy
        for _ in range(rounds):
            before, level = level, (energies[0] - bias) / energies[1]
            if abs(level - before) <= 1e-6 * before:  # its convergence is quadratic
                break
            guess = path.sample(path.times[1:])
            response = self._disturber.respond(worst.zeta, path.mesh, [guess], _constant(level))
            path, energies = response.path, self._disturber.energies(response, level)
        return float(np.sqrt(level))

    def _settled(self, zeta0: Array) -> Response:
        """Return the maximum on a horizon that is long enough."""
        short = self._maximise(zeta0, self._meshes[0])
        if self._disturber.tail(short) <= 1e-6:
            return short
        response = self._maximise(zeta0, self._meshes[1])
        growth = response.cost / short.cost - 1.0
        if growth > 1e-3:
            raise RunError(f"the cost grows by a part of {growth:.2g} when the horizon is doubled")
        return response

    def _maximise(self, zeta0: Array, mesh: Array) -> Response:
        level = np.array([self._level])
        guesses = self._disturber.guesses(zeta0, mesh, lambda t: level)
        return self._disturber.maximise(zeta0, mesh, guesses, _constant(self._level))


def worst_case(problem: Problem, zeta0: ArrayLike, u_control: SX | None = None) -> WorstCase:
    """Return the worst case of a control policy from one state; `WorstCaseSolver` is for many states.

    Parameters
    ----------
    problem : the game on its plant, γ finite
    zeta0 : (n,) initial state; its angles are taken the short way
    u_control : (k,) expression of the problem's ζ; None for the linear H-infinity policy

    Raises
    ------
    InputError
        If the policy is none, or the state is not n finite numbers inside the domain.
    """
    policy = linear_policy(problem) if u_control is None else u_control
    return WorstCaseSolver(ControlPolicy(problem, policy)).solve(problem.initial_state(zeta0))


def measured(
    disturber: Disturber, zeta0: Array, response: Response, parameters: ByInterval, started: float
) -> WorstCase:
    """Return what is told of a maximum; `started` is the `perf_counter` before it was looked for."""
    path, problem = response.path, disturber.problem
    output, disturbance = disturber.energies(response, float(problem.game.gamma**2))
    return WorstCase(
        zeta=zeta0,
        unbounded=None,
        ended=False,
        cost=-response.cost,
        path=path,
        second_order=response.second_order,
        reintegrated=disturber.cost(zeta0, path, parameters),
        reach=float(np.abs(path.states / problem.scale).max()),
        starts=-response.starts,
        output_energy=output,
        disturbance_energy=disturbance,
        iterations=response.iterations,
        seconds=time.perf_counter() - started,
    )


def unbounded(zeta0: Array, reason: str, seconds: float, *, ended: bool = False) -> WorstCase:
    """Return that no finite worst case is known from a state; `ended` if a limit is the reason."""
    return WorstCase(
        zeta=zeta0,
        unbounded=reason,
        ended=ended,
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


def _constant(level: float) -> ByInterval:
    return lambda mesh: np.full((len(mesh) - 1, 1), level)
