"""The saddle point from both sides: neither player gains by leaving it.

Along an optimal trajectory the players' policies are taken as the neighbouring-optimal feedback v(t, ζ)
of the single-player equivalent, u_1 = R^-1 R_eff v and u_2 = -γ^-2 W_d^-1 R_eff v. Then

    upper = max over u_2(t) of  ∫_0^T r(ζ, u_1(t, ζ), u_2) dt + ζ(T)'P ζ(T),
    lower = min over u_1(t) of  ∫_0^T r(ζ, u_1, u_2(t, ζ)) dt + ζ(T)'P ζ(T)

with r of (5). For any pair of policies lower <= V* <= upper, as max min <= min max, so the two enclose
the value of the game whatever the direct solution is worth; they meet if and only if the pair is a
saddle point (Basar and Bernhard 1995, ch. 2). Both are solved by collocation on a mesh of their own,
finer than the direct solution's, from the saddle point and from perturbed starts. Both maximisation
and minimisation are local: the second-order condition says that the responses are strict local optima,
the other starts are what there is against better ones elsewhere.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from casadi import DM
from numpy.typing import ArrayLike

from ...symbolic import Problem, RunError
from ...symbolic.arrays import Array
from ..direct import SecondOrder, Stage, against_control, against_disturbance
from ..limits import Limits, limited
from ..path import Trajectory
from ..settings import OfflineSettings
from ..solve import solve
from .neighbour import Feedback, NeighbouringOptimum, feedback_law
from .response import Guess, Responder, Response, Signal, perturbation


@dataclass(frozen=True)
class SaddleGap:
    """Best responses of both players to the other's optimal feedback.

    Attributes
    ----------
    zeta : (n,) initial state
    value : V(ζ) of the direct solution
    upper : the most that the disturbance makes of the control's feedback
    lower : the least that the control pays against the disturbance's feedback
    disturbance, control : second-order verdicts of the two responses
    upper_starts, lower_starts : (s,) cost reached from the saddle point and from each perturbed start,
        NaN where IPOPT did not converge inside the domain
    iterations : of IPOPT, all together
    seconds : wall time
    """

    zeta: Array
    value: float
    upper: float
    lower: float
    disturbance: SecondOrder
    control: SecondOrder
    upper_starts: Array
    lower_starts: Array
    iterations: int
    seconds: float

    @property
    def gap(self) -> float:
        """(upper - lower) / V, zero at a saddle point."""
        return (self.upper - self.lower) / self.value

    @property
    def holds(self) -> bool:
        """Whether both responses are strict local optima."""
        return self.disturbance.holds and self.control.holds


class BestResponse:
    """Responses of both players of one game; what can be shared between states is built once.

    Parameters
    ----------
    problem : the game on its plant, γ finite
    starts : perturbed starts of each player, beside the saddle point
    seed : of the perturbations
    limits : of one solve, both players together
    """

    def __init__(
        self, problem: Problem, *, starts: int = 2, seed: int = 0, limits: Limits | None = None
    ) -> None:
        self.problem = problem
        self.limits = Limits() if limits is None else limits
        self.starts = starts
        self.seed = seed
        game = problem.game
        v, parameters = feedback_law(problem.zeta, problem.n_inputs)
        shares = game.R_inverse @ game.R_eff, -game.disturbance_inverse @ game.R_eff
        self._shares = shares
        self._stages: tuple[Stage, Stage] = (
            against_control(problem, DM(shares[0]) @ v, parameters, problem.P),
            against_disturbance(problem, DM(shares[1]) @ v, parameters, problem.P),
        )
        self._neighbour = NeighbouringOptimum(problem)
        self._responders: dict[int, tuple[Responder, Responder]] = {}

    def solve(self, zeta0: Array, value: float, path: Trajectory) -> SaddleGap:
        """Return both best responses along an optimal `path` from `zeta0` with its value.

        Raises
        ------
        InputError
            If the state is not n finite numbers inside the domain.
        RunError
            If a response does not converge from any start, or the path has a conjugate point; an
            `EndedByLimitError` if the limits are reached.
        """
        zeta0 = self.problem.require_state(zeta0)
        with limited(self.limits):  # by the turn of the path
            return self._solve(self.problem.angles.beside(zeta0, path.states[0]), value, path)

    def _solve(self, zeta0: Array, value: float, path: Trajectory) -> SaddleGap:
        started = time.perf_counter()
        first, second = self._players(path.degree)
        mesh = self._mesh(value, path)
        times = first.times(mesh)
        feedback = self._neighbour.along(path, times)
        game = self.problem.game
        weights = game.gamma**2 * game.W_d, game.R
        upper, lower = (
            self._respond(player, zeta0, mesh, path, feedback, share, value / np.diag(weight))
            for player, share, weight in zip((first, second), self._shares[::-1], weights, strict=True)
        )
        return SaddleGap(
            zeta=zeta0,
            value=value,
            upper=-upper.cost,
            lower=lower.cost,
            disturbance=upper.second_order,
            control=lower.second_order,
            upper_starts=-upper.starts,
            lower_starts=lower.starts,
            iterations=upper.iterations + lower.iterations,
            seconds=time.perf_counter() - started,
        )

    def _respond(
        self,
        player: Responder,
        zeta0: Array,
        mesh: Array,
        path: Trajectory,
        feedback: Feedback,
        share: Array,
        energy: Array,
    ) -> Response:
        """Respond from the saddle point and from perturbed starts; `energy` is V in u^2 s."""
        states, v = path.sample(feedback.times)
        guesses: list[Guess] = [(states, v @ share.T)]
        rng = np.random.default_rng(self.seed)
        for _ in range(self.starts):
            push = perturbation(rng, 0.5 * np.sqrt(energy))
            try:
                guesses.append(self._perturbed(player, zeta0, feedback, share, push))
            except RunError:
                continue  # pushed too far
        return player.best(zeta0, mesh, guesses, feedback.parameters)

    def _perturbed(
        self, player: Responder, zeta0: Array, feedback: Feedback, share: Array, push: Signal
    ) -> Guess:
        """Simulate both policies, the free player's with a push on top."""

        def policy(t: float, zeta: Array) -> Array:
            return np.asarray(share @ feedback.v(t, zeta) + push(t))

        return player.rollout(zeta0, feedback.times, policy, feedback.parameters_at)

    def _mesh(self, value: float, path: Trajectory, *, rest: float = 1e-7) -> Array:
        """Return a mesh of halved intervals up to where ζ'P ζ is a negligible part of the value.

        Later ones are no longer than three growth times of the plant under the disturbance's policy
        alone: on longer ones a collocated control would gain from the discretisation.
        """
        problem = self.problem
        A, B = problem.linearization
        growth = np.linalg.eigvals(
            A + B @ problem.game.disturbance_inverse @ B.T @ problem.P
        ).real.max()
        longest = 3.0 / growth if growth > 0.0 else np.inf
        left = np.einsum("ij,jk,ik->i", path.at_mesh(), problem.P, path.at_mesh())
        last = int(np.argmax(left < rest * value)) or len(path.mesh) - 1
        pieces = [
            np.linspace(a, b, max(2, int(np.ceil((b - a) / longest))) + 1)[:-1]
            for a, b in pairwise(path.mesh[: last + 1])
        ]
        return np.append(np.concatenate(pieces), path.mesh[last])

    def _players(self, degree: int) -> tuple[Responder, Responder]:
        if degree not in self._responders:
            disturbance, control = (Responder(stage, degree) for stage in self._stages)
            self._responders[degree] = disturbance, control
        return self._responders[degree]


def saddle_gap(
    problem: Problem, zeta0: ArrayLike, settings: OfflineSettings | None = None
) -> SaddleGap:
    """Return both players' best responses from one state; `BestResponse` is for many states.

    The path is that of the certified solve.

    Parameters
    ----------
    problem : the game on its plant, γ finite
    zeta0 : (n,) initial state
    settings : of the certified solve

    Raises
    ------
    InputError
        If the state is not n finite numbers inside the domain.
    RunError
        If there is no optimum, a response does not converge from any start, or the path has a conjugate
        point.
    """
    limits = None if settings is None else settings.limits
    optimum = solve(problem, zeta0, settings).direct
    return BestResponse(problem, limits=limits).solve(optimum.zeta, optimum.value, optimum.trajectory)
