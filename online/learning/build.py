"""The parts of a learner, as its settings ask for them."""

from __future__ import annotations

import numpy as np

from ...symbolic import InputError, ValueFunctions
from ...symbolic.arrays import Array
from ..laws import Critic, Gradient, LeastSquares
from ..paper import Projection
from ..rows import CostateRows, Leash, Predictor, RowGains, RowSource, bellman_source
from .memory import EnvelopeMemory, Memory, NoMemory
from .safeguard import Guard, Safeguard, Unguarded
from .settings import LearnerSettings, SampleSettings


def critic_law(settings: LearnerSettings, n_basis: int) -> Critic:
    """Return the law that `rule` names; raises InputError for a user's, which a scenario makes."""
    if settings.rule == "gradient":
        return Gradient()
    if settings.rule != "least_squares":
        raise InputError(
            f"the rule is '{settings.rule}', a law of its own; give that law to the learner as `critic`"
        )
    return LeastSquares(n_basis, settings.forgetting, settings.covariance, settings.covariance_bound)


def projection(settings: LearnerSettings, reference: Array) -> Projection:
    """Return the projection onto the ball of `weight_bound` times |W_ref|."""
    bound = settings.weight_bound * float(np.linalg.norm(reference))
    return Projection(bound=bound, margin=0.1 * bound)


def row_source(
    settings: LearnerSettings,
    functions: ValueFunctions,
    samples: Array,
    paths: SampleSettings,
    predictor: Predictor,
    reference: Array,
) -> RowSource:
    """Return the rows of the `error` that is learned from."""
    gain = settings.gain_critic if settings.gain_samples is None else settings.gain_samples
    leash = Leash(settings.leash, reference)
    if settings.error == "costate":
        return CostateRows(
            functions,
            predictor.path_rows(paths.path_points),
            gain,
            leash,
            paths=paths.paths,
            spread=paths.spread,
            seed=paths.seed,
        )
    scale, Q = functions.problem.scale, functions.problem.game.Q
    floor = 1e-5 * float(scale @ Q @ scale)
    gains = RowGains(settings.gain_critic, gain, settings.normalizer, floor)
    return bellman_source(functions, samples, gains, leash)


def guard(settings: LearnerSettings, predictor: Predictor, reference: Array) -> Guard:
    """Return the safeguard, or none; without the Riccati solution it knows of no linear policy."""
    if not settings.safeguard:
        return Unguarded()
    return Safeguard(predictor, reference, may_use_linear=settings.reference == "riccati")


def memory(
    paths: SampleSettings, predictor: Predictor, envelope: Array | None, reference: Array
) -> Memory:
    """Return what learns weights for the whole envelope (n,), or none without one."""
    if envelope is None:
        return NoMemory()
    path_rows = predictor.path_rows(paths.path_points, "whole")
    return EnvelopeMemory(path_rows, predictor, envelope, reference, seed=paths.seed)
