"""What is watched of a learning step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...symbolic.arrays import Array
from ..laws import Equations


@dataclass(frozen=True)
class LearnerStep:
    """What the learner saw at a state, and the weights under which it saw it.

    Attributes
    ----------
    critic, actor_1, actor_2 : (m,) weights, before a step moves them
    bellman_error : δ at the state (17), in units of cost per second
    sample_error : rms over the samples of δ_j / (ζ_j'Qζ_j), or the root of the relative regret along
        the predicted paths; NaN without samples
    projecting : whether the smooth projection acts on an actor
    rows : what the critic learns from, state, samples and leash
    predicted_cost : J of the policy in use before the actors moved; NaN without safeguard
    accepted : part of the actors' step that was certified; 1 without safeguard
    fallback : whether the policy in use after the step is that of the reference weights or the linear
        H-infinity policy, since no other was certified
    linear : whether it is the latter
    rolled_back : whether the laws' step was not taken, because the weights or the information of it
        would not have been finite
    """

    critic: Array
    actor_1: Array
    actor_2: Array
    bellman_error: float
    sample_error: float
    projecting: bool
    rows: Equations
    predicted_cost: float = np.nan
    accepted: float = 1.0
    fallback: bool = False
    linear: bool = False
    rolled_back: bool = False
