"""The actor-critic: critic (19) or least squares, actors (20)(21), and what is watched of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..symbolic import Basis, Game, Problem, ValueFunctions
from ..symbolic.vehicle import Array
from .actor import Projection, actor_step
from .bellman import BellmanTerms, Residual, bellman_error
from .critic import LeastSquares, NormalEquations, gradient_step, row_weights
from .samples import rank_margin
from .settings import LearnerSettings


@dataclass(frozen=True)
class LearnerStep:
    """What the learner saw at a state, and the weights under which it saw it.

    Attributes
    ----------
    critic, actor_1, actor_2 : (m,) weights, before a step moves them
    bellman_error : δ at the state (17), in units of cost per second
    sample_error : rms over the samples of δ_j / (ζ_j'Qζ_j); NaN without samples
    projecting : whether the smooth projection acts on an actor
    """

    critic: Array
    actor_1: Array
    actor_2: Array
    bellman_error: float
    sample_error: float
    projecting: bool


class Learner:
    """Learn the value of a game from the Bellman error at the state and at sample points.

    Parameters
    ----------
    problem : the game on its plant
    basis : σ of the value function
    settings : rule and gains
    samples : (N, n) points ζ_j; N may be 0
    reference : (m,) weights that the leash pulls to and the projection bound is a multiple of
    initial : (m,) weights of critic and actors at the start; `reference` times weight_factor if None
    functions : compiled functions of problem and basis, if they exist already

    Attributes
    ----------
    critic, actor_1, actor_2 : (m,) Ŵ_c, Ŵ_a1, Ŵ_a2
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
    ) -> None:
        self.problem = problem
        self.basis = basis
        self.settings = settings
        self.functions = ValueFunctions(problem, basis) if functions is None else functions
        self.reference = reference
        start = reference * settings.weight_factor if initial is None else initial
        self.critic, self.actor_1, self.actor_2 = start.copy(), start.copy(), start.copy()
        self.projection = self._ball()
        self._least_squares = LeastSquares(
            basis.n_basis,
            settings.forgetting,
            settings.covariance,
            settings.covariance_bound,
        )
        self._samples = self._terms(samples) if len(samples) else None
        self._floor = 1e-5 * float(problem.scale @ problem.game.Q @ problem.scale)
        self._leash = self._leash_strength()

    @property
    def game(self) -> Game:
        """The game that is learned."""
        return self.problem.game

    def step(self, zeta: Array, dt: float) -> LearnerStep:
        """Learn for dt from the state ζ (n,) and the samples; move critic, then actors."""
        seen, rows = self._observe(zeta)
        if self.settings.rule == "gradient":
            self.critic = gradient_step(self.critic, rows, dt)
        else:
            self.critic = self._least_squares.step(self.critic, rows, dt)
        gains = (self.settings.gain_actor_1, self.settings.gain_actor_2)
        self.actor_1 = actor_step(self.actor_1, self.critic, gains[0], dt, self.projection)
        self.actor_2 = actor_step(self.actor_2, self.critic, gains[1], dt, self.projection)
        return seen

    def observe(self, zeta: Array) -> LearnerStep:
        """Return what a step at ζ (n,) would see, without moving the weights."""
        return self._observe(zeta)[0]

    def policies(self, zeta: Array) -> tuple[Array, Array]:
        """Return û_1 (14) and û_2 (15) at ζ, each (k,)."""
        u_control, u_disturbance = self.functions.policies(zeta, self.actor_1, self.actor_2)
        return u_control, u_disturbance

    def value(self, zeta: Array) -> float:
        """Return V_hat(ζ) = Ŵ_c'σ(ζ) (13)."""
        return float(self.critic @ self.functions.sigma(zeta)[0])

    def sample_residual(self) -> Residual | None:
        """Return δ_j and ω_j at the samples under the present weights, or None without samples."""
        return None if self._samples is None else self._residual(self._samples)

    def rank_margin(self) -> float:
        """Return λ_min of (18) under the present actors; 0 without samples."""
        residual = self.sample_residual()
        return 0.0 if residual is None else rank_margin(residual.omega)

    def _observe(self, zeta: Array) -> tuple[LearnerStep, NormalEquations]:
        terms = self._terms(zeta[None, :])
        here = self._residual(terms)
        omega, delta = here.omega, here.delta
        weights = self.settings.gain_critic * self._row_weights(omega, terms.state_cost)
        sample_error = np.nan
        if self._samples is not None:
            there = self._residual(self._samples)
            omega, delta = np.vstack([omega, there.omega]), np.append(delta, there.delta)
            weights = np.append(weights, self._sample_weights(there.omega))
            sample_error = float(np.sqrt(np.mean((there.delta / self._samples.state_cost) ** 2)))
        actors = (self.actor_1, self.actor_2)
        seen = LearnerStep(
            critic=self.critic,
            actor_1=self.actor_1,
            actor_2=self.actor_2,
            bellman_error=float(here.delta[0]),
            sample_error=sample_error,
            projecting=any(self.projection.active(actor) for actor in actors),
        )
        offset = self.critic - self.reference
        return seen, NormalEquations.of(omega, delta, weights, self._leash, offset)

    def _terms(self, points: Array) -> BellmanTerms:
        return BellmanTerms.at(points, self.functions.at(points), self.game)

    def _residual(self, terms: BellmanTerms) -> Residual:
        return bellman_error(terms, self.game, self.critic, self.actor_1, self.actor_2)

    def _row_weights(self, omega: Array, state_cost: Array) -> Array:
        return row_weights(self.settings.normalizer, omega, state_cost, self._floor)

    def _sample_weights(self, omega: Array) -> Array:
        """Return η_c w_j of the sample rows, shape (N,)."""
        assert self._samples is not None
        settings = self.settings
        gain = settings.gain_critic if settings.gain_samples is None else settings.gain_samples
        share = gain / len(self._samples) if settings.average_samples else gain
        return share * self._row_weights(omega, self._samples.state_cost)

    def _leash_strength(self) -> Array:
        """Return ρ for each weight: the leash times Σ w ω^2 of the samples at the reference."""
        if self._samples is None or self.settings.leash == 0.0:
            return np.zeros(self.basis.n_basis)
        reference = self.reference
        start = bellman_error(self._samples, self.game, reference, reference, reference)
        information = self._sample_weights(start.omega) @ start.omega**2
        return np.asarray(self.settings.leash * information)

    def _ball(self) -> Projection:
        bound = self.settings.weight_bound * float(np.linalg.norm(self.reference))
        return Projection(bound=bound, margin=0.1 * bound)
