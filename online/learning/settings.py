"""Settings of the learner and its samples; the `[learner]` and `[samples]` groups of a scenario."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    NonNegativeFloat,
    PositiveFloat,
    field_validator,
    model_validator,
)

from ...symbolic.pyfile import is_named
from ...symbolic.toml import Seed, Settings
from ..laws import Normalizer

AS_PRINTED: dict[str, Any] = {
    "rule": "gradient",
    "error": "bellman",
    "safeguard": False,
    "normalizer": "paper",
    "leash": 0.0,
    "gain_samples": None,
    "gain_actor_1": 2.0,  # (25) asks for actors that are slow beside the critic
    "gain_actor_2": 2.0,
}
"""What makes a learner that of the paper: (16)-(21) as printed, nothing that holds the weights."""
PERIOD = 0.25  # s, between learning steps, where the problem leaves time for it
RULES = ("gradient", "least_squares")


class LearnerSettings(Settings):
    """Actor-critic of (17)-(21); the defaults are what the shipped scenarios learn with.

    Attributes
    ----------
    rule : `gradient` is (19); `least_squares` is recursive, with forgetting; or a user's critic law as
        "file.py:make", where make(setup) returns a `laws.Critic`
    error : what the critic learns from: `bellman`, the Bellman error (17) at the samples, or `costate`,
        the error of its gradient's policy along predicted trajectories, see `rows.CostateRows`
    safeguard : move the actors only as far as the model predicts no higher cost, restart them from the
        reference weights where these are predicted to cost less, and use the linear H-infinity policy
        where that is
    horizon : of the predictions [s]; after it the cost is ζ'P ζ
    steps : of the integration over the horizon
    normalizer : weight of a row; `paper` is 1/p as printed, see `critic.row_weights`
    gain_critic : η_c of the row at the state [1/s]
    gain_samples : η_c of the sample rows [1/s]; as gain_critic when not given
    gain_actor_1, gain_actor_2 : η_a1, η_a2 of (20)(21) [1/s]
    forgetting : β of least squares [1/s]
    covariance, covariance_bound : Γ(0) and Γ_max as multiples of the identity
    leash : strength of the ridge towards the reference weights, relative to what the samples know of
        each weight at the start; 0 is none
    period : time between learning steps [s]; `learning_period` chooses it when not given
    weights : start from the Riccati solution (`riccati`) or from the record of a run (its path)
    weights_vehicle : whose Riccati solution that is, a shipped name or the path of a TOML file; the
        scenario's own vehicle when not given
    weight_factor : multiple of those weights to start from
    reference : the weights that leash, projection and safeguard hold to: `riccati`, those of the
        scenario's own vehicle, or `initial`, whatever the learner starts from (and then the safeguard
        knows of no linear H-infinity policy)
    weight_bound : projection bound as a multiple of the norm of the reference weights
    """

    rule: str = "least_squares"
    error: Literal["bellman", "costate"] = "costate"
    safeguard: bool = True
    horizon: Annotated[float, Field(gt=0.0, le=1e5)] = 30.0
    steps: Annotated[int, Field(ge=10, le=2000)] = 150
    normalizer: Normalizer = "state_cost"
    gain_critic: NonNegativeFloat = 1.0
    gain_samples: NonNegativeFloat | None = None
    gain_actor_1: PositiveFloat = 16.0
    gain_actor_2: PositiveFloat = 16.0
    forgetting: NonNegativeFloat = 4.0
    covariance: PositiveFloat = 1e6
    covariance_bound: PositiveFloat = 1e8
    leash: NonNegativeFloat = 0.001
    period: PositiveFloat | None = None
    weights: str = "riccati"
    weights_vehicle: str | None = None
    weight_factor: float = 1.0
    reference: Literal["riccati", "initial"] = "riccati"
    weight_bound: Annotated[float, Field(gt=1.0)] = 3.0

    @classmethod
    def as_printed(cls, **changes: Any) -> LearnerSettings:
        """Return the settings of the paper's learner, `AS_PRINTED`, with changes."""
        return cls.model_validate(AS_PRINTED | changes)

    def unused(self) -> dict[str, set[str]]:
        """Return, for each key that chooses among laws, the keys that the choice doesn't use."""
        found: dict[str, set[str]] = {"rule": set(), "error": set()}
        if self.rule != "least_squares":
            found["rule"] = {"forgetting", "covariance", "covariance_bound"}
        if self.error == "costate":
            found["error"] = {"normalizer"} | (
                {"gain_critic"} if self.gain_samples is not None else set()
            )
        return found

    @field_validator("rule")
    @classmethod
    def _known(cls, rule: str) -> str:
        if rule not in RULES and not is_named(rule):
            raise ValueError(
                f"there is no rule '{rule}', only 'gradient' and 'least_squares'; choose one of them "
                "(or give file.py:function)"
            )
        return rule

    @model_validator(mode="after")
    def _consistent(self) -> LearnerSettings:
        if self.covariance > self.covariance_bound:
            raise ValueError(
                f"covariance is {self.covariance:g}, but must not exceed covariance_bound = "
                f"{self.covariance_bound:g}; raise the bound"
            )
        period = PERIOD if self.period is None else self.period
        if self.forgetting * period > 1.0:
            raise ValueError(
                f"forgetting * period is {self.forgetting * period:g}, but must be at most 1 for "
                "the covariance to stay bounded; learn more often or forget more slowly"
            )
        if self.weights_vehicle is not None and self.weights != "riccati":
            raise ValueError(
                f"weights_vehicle is '{self.weights_vehicle}' and weights '{self.weights}', but only a "
                'Riccati solution belongs to a vehicle; leave one out, or set weights = "riccati"'
            )
        return self


class SampleSettings(Settings):
    """Sample points ζ_j of (18), and the trajectories that are predicted for `costate` rows.

    Attributes
    ----------
    number : N of the points, fixed in the envelope
    seed : of everything that is drawn
    inner : the points are shrunk by a factor uniform on (inner, 1), so that some lie near the origin
    spread : of the starts of predicted trajectories around the state, as a part of its largest scaled
        entry
    paths : trajectories predicted for `costate` rows, the first from the state itself
    path_points : points of each that give rows
    remember : also learn weights for the whole envelope, to be used when learning is switched off
    """

    number: Annotated[int, Field(ge=0, le=1_000_000)] = 2000
    seed: Seed = 1
    inner: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    spread: PositiveFloat = 0.2
    paths: Annotated[int, Field(ge=1, le=1000)] = 3
    path_points: Annotated[int, Field(ge=2, le=10_000)] = 20
    remember: bool = False
