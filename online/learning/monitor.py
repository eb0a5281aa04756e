"""What the proof asks of a learning run, watched while it runs.

(18) is about the regressors ω_j at fixed points ζ_j and the actor weights of the moment, whatever rows
the critic learns from: c_lower = λ_min(Σ ω_j ω_j' / p_j), p_j = sqrt(1 + ω_j'ω_j). It moves with the
actors, so a uniform bound is its infimum over the run. Beside it stands what the critic does learn
from, M = η_c Σ w ω ω' + diag(ρ), its rows and the leash, each weight in its own scale S = diag(M)^-1/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...symbolic.arrays import Array
from ..laws import Equations
from ..paper import BellmanTerms, Residual, bellman_error, regressor_spectrum
from ..rows import terms_at
from .learner import Learner
from .learner_step import LearnerStep

BLOCK = 100  # points that are evaluated together


@dataclass(frozen=True)
class MonitorSample:
    """What the monitor sees at one time, under the weights that the learning step saw.

    Attributes
    ----------
    time : [s]
    rank_margin, rank_bound : c_lower and c_upper, least and largest eigenvalue of (18)'s sum [-]
    row_margin : λ_min(S M S) of the critic's own rows and leash, 1 where no two weights compete [-]
    row_rank : directions of the m in which the rows say more than the leash
    regressor, regressor_normalized : largest |ω_j| [1/s] and |ω_j| / p_j [-] over the fixed points
    fixed_error_rms, fixed_error_max : rms of δ_j / ζ_j'Qζ_j [-] and largest |δ_j| [cost/s] there
    actor_norm : (2,) |Ŵ_a1| and |Ŵ_a2| as parts of the projection's bound; it acts above 1
    actor_distance : (2,) |Ŵ_c - Ŵ_a1| and |Ŵ_c - Ŵ_a2| over |Ŵ_c|
    """

    time: float
    rank_margin: float
    rank_bound: float
    row_margin: float
    row_rank: int
    regressor: float
    regressor_normalized: float
    fixed_error_rms: float
    fixed_error_max: float
    actor_norm: Array
    actor_distance: Array


class Monitor:
    """Watch a learner.

    Parameters
    ----------
    learner : whose game, functions and projection bound are used; it is not changed
    points : (N, n) fixed ζ_j of (18); N may be 0, which leaves (18) no rank
    """

    def __init__(self, learner: Learner, points: Array) -> None:
        self._learner = learner
        self._points = points

    def sample(self, time: float, seen: LearnerStep) -> MonitorSample:
        """Return what the weights of a learning step at `time` [s] are like."""
        actors = np.array([seen.actor_1, seen.actor_2])
        norm = np.linalg.norm(seen.critic)
        return MonitorSample(
            time=time,
            row_margin=row_margin(seen.rows),
            row_rank=row_rank(seen.rows),
            actor_norm=np.linalg.norm(actors, axis=1) / self._learner.projection.bound,
            actor_distance=np.linalg.norm(seen.critic - actors, axis=1) / norm,
            **self._at_points(seen),
        )

    def _at_points(self, seen: LearnerStep) -> dict[str, float]:
        if not len(self._points):
            return {"rank_margin": 0.0, "rank_bound": 0.0} | dict.fromkeys(_ERRORS, np.nan)
        residual = self._residual(seen)
        if not np.all(np.isfinite(residual.delta)):
            return {"rank_margin": np.nan, "rank_bound": np.nan} | dict.fromkeys(_ERRORS, np.nan)
        spectrum = regressor_spectrum(residual.omega)
        size = float(np.linalg.norm(residual.omega, axis=1).max())
        relative = residual.delta / self._terms.state_cost
        few = len(self._points) < residual.omega.shape[1]
        return {
            "rank_margin": 0.0 if few else float(max(spectrum[0], 0.0)),
            "rank_bound": float(spectrum[-1]),
            "regressor": size,
            "regressor_normalized": size / float(np.sqrt(1.0 + size**2)),
            "fixed_error_rms": float(np.sqrt(np.mean(relative**2))),
            "fixed_error_max": float(np.abs(residual.delta).max()),
        }

    def _residual(self, seen: LearnerStep) -> Residual:
        weights = (seen.critic, seen.actor_1, seen.actor_2)
        return bellman_error(self._terms, self._learner.game, *weights)

    @cached_property
    def _terms(self) -> BellmanTerms:
        """What the points alone decide; in blocks, so that σ' of all of them is never in memory."""
        blocks = [self._points[i : i + BLOCK] for i in range(0, len(self._points), BLOCK)]
        parts = [terms_at(self._learner.functions, block) for block in blocks]
        return BellmanTerms(
            state_cost=np.concatenate([part.state_cost for part in parts]),
            sigma_f=np.concatenate([part.sigma_f for part in parts]),
            sigma_g=np.concatenate([part.sigma_g for part in parts]),
        )


def row_margin(rows: Equations) -> float:
    """Return λ_min(S M S); at least l/(1+l) where the leash is the part l of each weight's rows.

    NaN if a row is not finite.
    """
    if not np.all(np.isfinite(rows.matrix)):
        return np.nan
    return float(max(np.linalg.eigvalsh(_scaled(rows, rows.matrix))[0], 0.0))


def row_rank(rows: Equations) -> int:
    """Return in how many directions v' Σ η w ω ω' v > v'diag(ρ) v, by the inertia of M - 2 diag(ρ).

    0 if a row is not finite.
    """
    if not np.all(np.isfinite(rows.matrix)):
        return 0
    excess = np.linalg.eigvalsh(_scaled(rows, rows.matrix - 2.0 * np.diag(rows.leash)))
    return int(np.sum(excess > len(excess) * np.finfo(float).eps * max(excess[-1], 1.0)))


def _scaled(rows: Equations, matrix: Array) -> Array:
    """Return S `matrix` S; a weight that no row says anything about stays zero."""
    diagonal = np.diag(rows.matrix)
    scale = np.where(diagonal > 0.0, diagonal, np.inf) ** -0.5
    return np.asarray(scale[:, None] * matrix * scale)


_ERRORS = ("regressor", "regressor_normalized", "fixed_error_rms", "fixed_error_max")
