"""The actor-critic: critic (19) or least squares, and actors (20)(21)."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

import numpy as np

from ...symbolic import Basis, Game, InputError, Problem, ValueFunctions
from ...symbolic.arrays import Array
from ...symbolic.errors import is_told
from ...symbolic.game import require_time_step
from ..laws import Critic, actor_step
from ..paper import Residual, value
from ..rows import Observation, Predictor, Weights
from ..vector import library
from . import build
from .learner_step import LearnerStep
from .safeguard import Accepted, Actors, Certified, Unguarded
from .settings import LearnerSettings, SampleSettings

logger = logging.getLogger("stationkeep")
LARGEST = 1e100  # of a weight: what is computed from it stays finite


class Learner:
    """Learn the value of a game from the errors at the state and at sample points.

    Parameters
    ----------
    problem : the game on its plant
    basis : σ of the value function
    settings : rule and gains
    samples : (N, n) fixed points ζ_j, N may be 0
    reference : (m,) weights that the leash pulls to, the projection bound is a multiple of, and the
        safeguard falls back to; beside the linear H-infinity policy where the settings say `riccati`
    initial : (m,) weights of critic and actors at the start; `reference` times weight_factor if None
    functions : compiled functions of problem and basis, if they exist already
    paths : settings of the predicted paths of `costate` rows
    envelope : (n,) half-widths of what is remembered; None remembers nothing
    critic : another critic law than the one that the settings name

    Attributes
    ----------
    critic, actor_1, actor_2 : (m,) Ŵ_c, Ŵ_a1, Ŵ_a2
    linear : whether the linear H-infinity policy is in use instead of the actors'
    rolled_back : how many steps were not taken, since they would not have been finite; logged at 1, 10,
        100, ...
    source, law, projection, guard, memory : what a step consists of

    Raises
    ------
    InputError
        If the weights to start from, or those of reference, are not finite.
    """

    def __init__(
        self,
        problem: Problem,
        basis: Basis,
        settings: LearnerSettings,
        samples: Array,
        reference: Array,
        initial: Array | None = None,
        functions: ValueFunctions | None = None,
        paths: SampleSettings | None = None,
        envelope: Array | None = None,
        critic: Critic | None = None,
    ) -> None:
        self.problem, self.basis, self.settings = problem, basis, settings
        self.functions = ValueFunctions(problem, basis) if functions is None else functions
        self.reference = reference
        start = reference * settings.weight_factor if initial is None else initial
        if not (np.isfinite(start).all() and np.isfinite(reference).all()):
            raise InputError(
                "the weights to start from contain NaN or infinity; take them from another record, or "
                'start from learner.weights = "riccati"'
            )
        self.critic, self.actor_1, self.actor_2 = start.copy(), start.copy(), start.copy()
        self._initial = (self.actor_1, self.actor_2)
        self.linear, self.rolled_back = False, 0
        self._paths = paths = SampleSettings() if paths is None else paths
        self.predictor = Predictor(self.functions, settings.horizon, settings.steps)
        self.source = build.row_source(
            settings, self.functions, samples, paths, self.predictor, reference
        )
        self.law = build.critic_law(settings, basis.n_basis) if critic is None else critic
        self.projection = build.projection(settings, reference)
        self.guard = build.guard(settings, self.predictor, reference)
        self.memory = build.memory(paths, self.predictor, envelope, reference)

    @property
    def game(self) -> Game:
        """The game that is learned."""
        return self.problem.game

    def build(self) -> Iterator[str]:
        """Build what steps need, so that none has to, and yield the functions' names.

        Beside policies, σ' and the vector code, which have no names of their own here.
        """
        s, paths, origin = self.settings, self._paths, np.zeros(self.problem.n_states)
        self.policies(origin)
        self.functions.at(origin[None, :])
        if self.functions.compiled:
            library()
            if s.error == "bellman":
                self.functions.many_terms  # noqa: B018 - built when first asked for
                self.functions.terms  # noqa: B018
                yield "sparse_terms"
        n_paths = paths.paths if s.error == "costate" else int(paths.remember)
        if s.safeguard or n_paths:
            yield from self.predictor.path_rows(paths.path_points).build(n_paths)

    def step(self, zeta: Array, dt: float) -> LearnerStep:
        """Learn for dt [s] from the state ζ (n,) and the samples: the algorithm.

        A step that would leave weights or information not finite is not taken: all stay as they were.

        Raises
        ------
        InputError
            If ζ is not n finite numbers in the domain, or dt no positive time.
        """
        given = isinstance(zeta, np.ndarray) and zeta.shape == (self.problem.n_states,)
        if not (given and math.isfinite(sum(zeta.tolist()))):
            zeta = self.problem.require_state(zeta)
        dt = require_time_step(dt)
        # certify: the actors of before, or the reference's
        start = self.guard.certified(zeta, (self.actor_1, self.actor_2))
        weights = (self.critic, *start.actors)
        # rows of (17)
        self.source.move(zeta, weights)
        seen = self.source.at(zeta, weights)
        # critic (19), actors (20)(21)
        moved = self._moved(seen, start.actors, dt)
        if moved is None:
            end = self.guard.kept(zeta, start)
        else:
            # accept what is certified of their way
            self.critic, proposed = moved
            end = self.guard.accepted(zeta, start, proposed)
        (self.actor_1, self.actor_2), self.linear = end.actors, end.linear
        self.memory.step()
        return self._recorded(weights, seen, start, end, rolled_back=moved is None)

    def _moved(self, seen: Observation, actors: Actors, dt: float) -> tuple[Array, Actors] | None:
        """Return critic and proposed actors after dt [s], or None, the law put back, if not finite."""
        before = dict(getattr(self.law, "__dict__", {}))
        gains = (self.settings.gain_actor_1, self.settings.gain_actor_2)
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                # critic (19)
                critic = self.law.step(self.critic, seen.equations, dt)
                # actors (20)(21)
                proposed = (
                    actor_step(actors[0], critic, gains[0], dt, self.projection),
                    actor_step(actors[1], critic, gains[1], dt, self.projection),
                )
            if all(np.abs(weights).max() < LARGEST for weights in (critic, *proposed)):
                return critic, proposed
        except np.linalg.LinAlgError as error:
            logger.debug("the rows of a learning step can't be solved: %s", error)
        if before:
            vars(self.law).update(before)
        self.rolled_back += 1
        if is_told(self.rolled_back):
            logger.warning(
                "a learning step would not have been finite and was not taken (%d so far)",
                self.rolled_back,
            )
        return None

    def certify(self, zeta: Array) -> LearnerStep:
        """Use the initial weights where they are predicted to cost less than the reference, else that.

        For a learner that is not to learn, with a safeguard.
        """
        start = self.guard.certified(zeta, self._initial)
        end = self._used(zeta, start)
        weights = (self.critic, *end.actors)
        return self._recorded(weights, self.source.at(zeta, weights), start, end)

    def keep(self, zeta: Array) -> None:
        """Use the present weights, or what is predicted to cost less at ζ (n,), and learn nothing."""
        self._used(zeta, self.guard.certified(zeta, (self.actor_1, self.actor_2)))

    def _used(self, zeta: Array, start: Certified) -> Accepted:
        end = self.guard.kept(zeta, start)
        (self.actor_1, self.actor_2), self.linear = end.actors, end.linear
        return end

    def observe(self, zeta: Array) -> LearnerStep:
        """Return what a step at ζ (n,) would see at the present samples, without moving anything."""
        actors, free = (self.actor_1, self.actor_2), Unguarded()
        weights = (self.critic, *actors)
        start = free.certified(zeta, actors)
        end = free.accepted(zeta, start, actors)
        return self._recorded(weights, self.source.at(zeta, weights), start, end)

    def policies(self, zeta: Array) -> tuple[Array, Array]:
        """Return û_1 (14) and û_2 (15) at ζ, each (k,); the linear policies' where they are in use."""
        if self.linear:
            K_1, K_2 = self.problem.linear_gains
            return -K_1 @ zeta, K_2 @ zeta
        u_control, u_disturbance = self.functions.policies(zeta, self.actor_1, self.actor_2)
        return u_control, u_disturbance

    def value(self, zeta: Array) -> float:
        """Return V_hat(ζ) = Ŵ_c'σ(ζ) (13)."""
        return float(value(self.functions.sigma(zeta)[0], self.critic))

    def predicted_cost(self, zeta: Array, actor_1: Array, actor_2: Array) -> float:
        """Return J from ζ (n,) under these actor weights, infinite if they lose the vehicle."""
        return self.predictor.cost(zeta, actor_1, actor_2)

    def sample_residual(self) -> Residual:
        """Return δ_j and ω_j at the samples under the present weights; without samples no rows."""
        return self.source.residual((self.critic, self.actor_1, self.actor_2))

    def _recorded(
        self,
        weights: Weights,
        seen: Observation,
        start: Certified,
        end: Accepted,
        *,
        rolled_back: bool = False,
    ) -> LearnerStep:
        """Return the step as it is recorded: what was seen, under which weights, and what was done."""
        return LearnerStep(
            critic=weights[0],
            actor_1=weights[1],
            actor_2=weights[2],
            bellman_error=seen.bellman_error,
            sample_error=seen.sample_error,
            projecting=self.projection.active(weights[1]) or self.projection.active(weights[2]),
            rows=seen.equations,
            predicted_cost=start.cost,
            accepted=end.part,
            fallback=(start.restarted and end.part == 0.0) or end.linear,
            linear=end.linear,
            rolled_back=rolled_back,
        )
