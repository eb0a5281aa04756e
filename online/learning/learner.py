"""The actor-critic: critic (19) or least squares, and actors (20)(21)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...symbolic import Basis, Game, Path, Problem, ValueFunctions, growing_steps
from ...symbolic.arrays import Array
from ..laws import (
    Equations,
    LeastSquares,
    NormalEquations,
    actor_step,
    gradient_step,
    library,
    row_weights,
)
from ..paper import BellmanTerms, Projection, Residual, bellman_error, value
from ..rows import (
    BellmanSource,
    CostateSource,
    FixedSamples,
    PathRows,
    RelativeTo,
    RowGains,
    RowSource,
    SampleRows,
    SampleStrategy,
    VectorRows,
    Weights,
)
from .learner_step import LearnerStep
from .memory import Memory
from .safeguard import Safeguard
from .settings import LearnerSettings, SampleSettings


class Learner:
    """Learn the value of a game from the errors at the state and at sample points.

    Parameters
    ----------
    problem : the game on its plant
    basis : σ of the value function
    settings : rule and gains
    samples : (N, n) fixed points ζ_j, N may be 0; or a strategy that moves them
    reference : (m,) weights that the leash pulls to, the projection bound is a multiple of, and the
        safeguard falls back to; beside the linear H-infinity policy where the settings say `riccati`
    initial : (m,) weights of critic and actors at the start; `reference` times weight_factor if None
    functions : compiled functions of problem and basis, if they exist already
    paths : settings of the predicted paths of `costate` rows
    envelope : (n,) half-widths of what is remembered; None remembers nothing

    Attributes
    ----------
    critic, actor_1, actor_2 : (m,) Ŵ_c, Ŵ_a1, Ŵ_a2
    linear : whether the linear H-infinity policy is in use instead of the actors'
    memory : weights for the whole envelope, or None
    """

    def __init__(
        self,
        problem: Problem,
        basis: Basis,
        settings: LearnerSettings,
        samples: Array | SampleStrategy,
        reference: Array,
        initial: Array | None = None,
        functions: ValueFunctions | None = None,
        paths: SampleSettings | None = None,
        envelope: Array | None = None,
    ) -> None:
        self.problem = problem
        self.basis = basis
        self.settings = settings
        self.functions = ValueFunctions(problem, basis) if functions is None else functions
        self.reference = reference
        start = reference * settings.weight_factor if initial is None else initial
        self.critic, self.actor_1, self.actor_2 = start.copy(), start.copy(), start.copy()
        self._initial = (self.actor_1, self.actor_2)
        self.linear = False
        self.projection = self._ball()
        self._least_squares = LeastSquares(
            basis.n_basis,
            settings.forgetting,
            settings.covariance,
            settings.covariance_bound,
        )
        self._floor = 1e-5 * float(problem.scale @ problem.game.Q @ problem.scale)
        self._steps = growing_steps(settings.horizon, settings.steps)
        self._vector: VectorRows | None = None
        self._source = self._row_source(samples, paths or SampleSettings())
        self._fixed_leash = self._leash(reference) if settings.error == "bellman" else None
        self.memory = self._new_memory(envelope, paths or SampleSettings())
        self._guard = self._safeguard() if settings.safeguard else None

    @property
    def game(self) -> Game:
        """The game that is learned."""
        return self.problem.game

    def step(self, zeta: Array, dt: float) -> LearnerStep:
        """Learn for dt from the state ζ (n,) and the samples; move critic, then actors."""
        actors, cost, restarted = (self.actor_1, self.actor_2), np.nan, False
        if self._guard is not None:
            actors, cost, restarted = self._guard.certified(zeta, actors)
        self.actor_1, self.actor_2 = actors
        self._source.move(zeta, self._weights)
        seen = self.observe(zeta)
        if self.settings.rule == "gradient":
            self.critic = gradient_step(self.critic, seen.rows, dt)
        else:
            self.critic = self._least_squares.step(self.critic, seen.rows, dt)
        gains = (self.settings.gain_actor_1, self.settings.gain_actor_2)
        proposed = (
            actor_step(actors[0], self.critic, gains[0], dt, self.projection),
            actor_step(actors[1], self.critic, gains[1], dt, self.projection),
        )
        if self._guard is not None:
            proposed, accepted, reached = self._guard.accepted(zeta, actors, proposed, cost)
            self.linear = self._guard.linear_cost(zeta) < reached
            seen = self._judged(seen, cost, accepted, restarted and accepted == 0.0)
        self.actor_1, self.actor_2 = proposed
        if self.memory is not None:
            self.memory.step()
        return seen

    def certify(self, zeta: Array) -> LearnerStep:
        """Use the initial weights where they are predicted to cost less than the reference, else that.

        For a learner that is not to learn; it needs the safeguard.
        """
        assert self._guard is not None
        (self.actor_1, self.actor_2), cost, restarted = self._guard.certified(zeta, self._initial)
        self.linear = self._guard.linear_cost(zeta) < cost
        return self._judged(self.observe(zeta), cost, 0.0, restarted)

    def _judged(self, seen: LearnerStep, cost: float, accepted: float, restarted: bool) -> LearnerStep:
        """Return the step with what the safeguard did."""
        return replace(
            seen,
            predicted_cost=cost,
            accepted=accepted,
            fallback=restarted or self.linear,
            linear=self.linear,
        )

    def observe(self, zeta: Array) -> LearnerStep:
        """Return what a step at ζ (n,) would see at the present samples, without moving anything."""
        delta, error, rows = self._seen(zeta)
        return LearnerStep(
            critic=self.critic,
            actor_1=self.actor_1,
            actor_2=self.actor_2,
            bellman_error=delta,
            sample_error=error,
            projecting=any(self.projection.active(actor) for actor in self._weights[1:]),
            rows=rows,
            information=self._least_squares.information,
        )

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
        return self._predict(zeta, actor_1, actor_2).cost

    def sample_residual(self) -> Residual | None:
        """Return δ_j and ω_j at the samples under the present weights, or None without samples."""
        rows = self._source.rows(self._weights)
        return None if rows is None else rows.residual

    @property
    def _weights(self) -> Weights:
        return self.critic, self.actor_1, self.actor_2

    def _seen(self, zeta: Array) -> tuple[float, float, Equations]:
        """Return δ at ζ, the error at the samples, and the rows of both, summed."""
        if self._vector is not None and self._fixed_leash is not None:
            return self._vector.observe(zeta, self._weights, self._fixed_leash, self.reference)
        terms = self._terms(zeta[None, :])
        here = self._residual(terms, self._weights)
        there = self._source.rows(self._weights)
        error = np.nan if there is None else there.error
        return float(here.delta[0]), error, self._rows(terms, here, there)

    def _rows(self, terms: BellmanTerms, here: Residual, there: SampleRows | None) -> NormalEquations:
        """Sum the rows at the state and at the samples, and the leash."""
        omega, delta = here.omega, here.delta
        weights = self.settings.gain_critic * self._row_weights(omega, terms.state_cost)
        if self.settings.error == "costate":
            omega, delta, weights = omega[:0], delta[:0], weights[:0]
        if there is not None:
            omega, delta = (
                np.vstack([omega, there.residual.omega]),
                np.append(delta, there.residual.delta),
            )
            weights = np.append(weights, self._gained(there))
        leash = self._fixed_leash if self._fixed_leash is not None else self._leash_of(there)
        offset = self.critic - self.reference
        return NormalEquations.of(omega, delta, weights, leash, offset)

    def _terms(self, points: Array) -> BellmanTerms:
        return BellmanTerms.at(points, self.functions.at(points), self.game)

    def _residual(self, terms: BellmanTerms, weights: Weights) -> Residual:
        return bellman_error(terms, self.game, *weights)

    def _row_weights(self, omega: Array, state_cost: Array) -> Array:
        return row_weights(self.settings.normalizer, omega, state_cost, self._floor)

    def _gained(self, rows: SampleRows) -> Array:
        """Return η_c w_j of the sample rows, shape (N,)."""
        return self._sample_gain(len(rows)) * rows.weights

    def _sample_gain(self, n_samples: int) -> float:
        settings = self.settings
        gain = settings.gain_critic if settings.gain_samples is None else settings.gain_samples
        return gain / n_samples if settings.average_samples else gain

    def _leash(self, reference: Array) -> Array:
        """Return the leash at the reference weights."""
        return self._leash_of(self._source.rows((reference, reference, reference)))

    def _leash_of(self, rows: SampleRows | None) -> Array:
        """Return ρ for each weight: the leash times Σ w ω^2 of the samples."""
        if rows is None or self.settings.leash == 0.0:
            return np.zeros(self.basis.n_basis)
        return np.asarray(self.settings.leash * (self._gained(rows) @ rows.residual.omega**2))

    def _ball(self) -> Projection:
        bound = self.settings.weight_bound * float(np.linalg.norm(self.reference))
        return Projection(bound=bound, margin=0.1 * bound)

    def _predict(self, zeta: Array, actor_1: Array, actor_2: Array) -> Path:
        prediction = self.functions.prediction(self.settings.steps)
        return prediction.path(zeta, actor_1, actor_2, self._steps)

    def _safeguard(self) -> Safeguard:
        prediction = self.functions.prediction(self.settings.steps)

        def linear_cost(zeta: Array) -> float:
            return prediction.linear_path(zeta, self._steps).cost

        if self.settings.reference != "riccati":  # nothing is known but the start
            return Safeguard(self.predicted_cost, self.reference)
        return Safeguard(self.predicted_cost, self.reference, linear_cost)

    def _row_source(self, samples: Array | SampleStrategy, paths: SampleSettings) -> RowSource:
        if self.settings.error == "costate":
            path_rows = self._path_rows(paths.path_points)
            return CostateSource(
                path_rows,
                self.problem.scale,
                paths=paths.paths,
                spread=paths.spread,
                seed=paths.seed,
            )
        strategy = FixedSamples(samples) if isinstance(samples, np.ndarray) else samples
        return BellmanSource(
            strategy, self._terms, self._residual, self._row_weights, self._predict, self._placed
        )

    def _placed(self, points: Array) -> None:
        """Tell the compiled rows, if there is a compiler, where the samples are."""
        compiled = library() if self.functions.compiled and len(points) else None
        if self._vector is None and compiled is not None:
            settings = self.settings
            gain = self._sample_gain(len(points))
            gains = RowGains(settings.gain_critic, gain, settings.normalizer, self._floor)
            self._vector = VectorRows(self.functions, compiled, len(points), gains)
        if self._vector is not None:
            self._vector.place(points)

    def _path_rows(self, points: int, relative_to: RelativeTo = "rest") -> PathRows:
        prediction = self.functions.prediction(self.settings.steps)
        return PathRows(prediction, self._steps, points, relative_to)

    def _new_memory(self, envelope: Array | None, paths: SampleSettings) -> Memory | None:
        if envelope is None:
            return None
        path_rows = self._path_rows(paths.path_points, "whole")
        return Memory(path_rows, self.predicted_cost, envelope, self.reference, seed=paths.seed)
