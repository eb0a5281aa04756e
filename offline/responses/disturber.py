"""Maximise what a control policy costs over the disturbance, by collocation, from several starts.

The mesh is aligned with the sign changes of the switching functions, and a trajectory that leaves the
envelope far behind counts as run off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from ...symbolic import Problem, RunError
from ...symbolic.arrays import Array
from ..direct import Stage
from ..path import Plant, Policy, Trajectory, settle
from .response import Guess, Responder, Response, Signal, perturbation, reintegrate_response

ByInterval = Callable[[Array], Array]
"""From a mesh (K + 1,) to the parameters of the stage on its intervals (K, q)."""


class Disturber:
    """The disturbance's side of a stage made by `against_control`.

    Parameters
    ----------
    problem : the game on its plant
    stage : the disturbance's problem
    degree : of the Radau collocation
    starts : perturbed starts, beside no disturbance and the linear worst case
    seed : of the perturbations
    reach : excursion that counts as having run off, in half-widths, or in multiples of the initial
        state where that lies outside
    patience : IPOPT's limit on its iterations
    """

    def __init__(
        self,
        problem: Problem,
        stage: Stage,
        degree: int,
        *,
        starts: int,
        seed: int,
        reach: float,
        patience: int = 80,
    ) -> None:
        self.problem, self.stage = problem, stage
        self.starts, self.seed, self.reach = starts, seed, reach
        self.rest: Array = -stage.terminal
        self._plant = Plant(problem)
        self._responder = Responder(stage, degree, patience=patience)

    def maximise(
        self,
        zeta0: Array,
        mesh: Array,
        guesses: Iterable[Guess],
        parameters: ByInterval,
        *,
        fixed: Array | None = None,
        rounds: int = 4,
    ) -> Response:
        """Return the best maximum, on a mesh aligned with the sign changes of switching functions.

        Parameters
        ----------
        guesses : at the collocation `times` of the mesh
        fixed : points of the mesh that stay where they are

        Raises
        ------
        RunError
            If there is none, or it has run off.
        """

        def solve_on(mesh: Array, before: Response) -> Response:
            return self.respond(zeta0, mesh, [before.path.sample(self.times(mesh))], parameters)

        responses, _ = settle(
            self._plant,
            mesh,
            self.respond(zeta0, mesh, guesses, parameters),
            lambda response: response.path,
            solve_on,
            fixed=fixed,
            rounds=rounds,
        )
        return replace(
            responses[-1],
            starts=responses[0].starts,
            iterations=sum(response.iterations for response in responses),
        )

    def respond(
        self, zeta0: Array, mesh: Array, guesses: Iterable[Guess], parameters: ByInterval
    ) -> Response:
        """Return the best maximum from the guesses, on this mesh; refuse one that has run off."""
        at_points = np.repeat(parameters(mesh), self._responder.degree, axis=0)
        response = self._responder.best(zeta0, mesh, guesses, at_points)
        reach, first = (
            float(np.abs(states / self.problem.scale).max()) for states in (response.path.states, zeta0)
        )
        if reach > self.reach * max(1.0, first):
            raise RunError(f"a state reaches {reach:.3g} half-widths of the envelope")
        return response

    def guesses(self, zeta0: Array, mesh: Array, parameters: Signal) -> Iterator[Guess]:
        """Yield simulations without disturbance, with the linear worst case, and with random ones.

        `parameters`: of the stage as a function of time.

        Raises
        ------
        RunError
            If the policy loses the plant without a disturbance.
        """
        game, (_, B) = self.problem.game, self.problem.linearization
        worst = game.disturbance_inverse @ B.T @ self.rest
        energy = zeta0 @ self.rest @ zeta0 / (game.gamma**2 * np.diag(game.W_d))
        rng = np.random.default_rng(self.seed)
        pushes = [perturbation(rng, 0.5 * np.sqrt(energy)) for _ in range(self.starts)]
        times = self.times(mesh)

        def simulated(policy: Policy) -> Guess:
            return self._responder.rollout(zeta0, times, policy, parameters)

        yield simulated(lambda t, zeta: np.zeros(self.problem.n_inputs))
        for policy in (lambda t, zeta: worst @ zeta, *(_open_loop(push) for push in pushes)):
            try:
                yield simulated(policy)
            except RunError:
                continue  # pushed too far

    def times(self, mesh: Array) -> Array:
        """Return the collocation times of a mesh, shape (K d,) [s]."""
        return self._responder.times(mesh)

    def cost(self, zeta0: Array, path: Trajectory, parameters: ByInterval) -> float:
        """Return the cost when scipy integrates the closed loop under the input of a path."""
        rows = reintegrate_response(self.stage, zeta0, path, parameters(path.mesh))
        end = rows[-1, :-1]
        return float(end @ self.rest @ end - rows[-1, -1])

    def tail(self, response: Response) -> float:
        """Return the part of the cost that is ζ(T)'E ζ(T)."""
        end = response.path.states[-1]
        return float(end @ self.rest @ end) / max(-response.cost, np.finfo(float).tiny)

    def energies(self, response: Response, level: float) -> tuple[float, float]:
        """Return ∫ |z|^2 dt with the rest, and ∫ d'W_d d dt."""
        path, W_d = response.path, self.problem.game.W_d
        disturbance = float(path.quadrature(np.sum(path.v @ W_d * path.v, axis=1))[-1])
        return level * disturbance - response.cost, disturbance


def _open_loop(signal: Signal) -> Policy:
    return lambda t, zeta: signal(t)
