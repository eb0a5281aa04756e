"""What drives a plant: any control law, and the learner's."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from ...symbolic import InputError, Setup
from ...symbolic.arrays import Array
from ...symbolic.game import require_time_step
from ..laws import Critic
from ..learning import Learner, LearnerSettings, LearnerStep, SampleSettings, learning_period
from ..rows import draw_samples
from .hold import MeanState


class Policy(Protocol):
    """A control law u_1(ζ), and the disturbance player that answers it in `game` mode.

    Attributes
    ----------
    u_control, u_disturbance : (k,), (k_2,) u_1 and u_2 at the last state
    """

    @property
    def u_control(self) -> Array:
        """u_1 at the last state, (k,)."""
        ...

    @property
    def u_disturbance(self) -> Array:
        """u_2 at the last state, (k_2,)."""
        ...

    def step(self, zeta: Array, dt: float) -> Array:
        """Return u_1 at ζ (n,) to hold for dt [s], shape (k,)."""
        ...


class LearnerScenario(Protocol):
    """What a learner in a loop needs of a scenario."""

    @property
    def learner(self) -> LearnerSettings:
        """Settings of the actor-critic."""
        ...

    @property
    def samples(self) -> SampleSettings:
        """Settings of the sample points."""
        ...

    def setup(self) -> Setup:
        """Return problem, basis and envelope."""
        ...

    def initial_weights(self) -> Array | None:
        """Return the weights to start from, or None for weight_factor times the Riccati weights."""
        ...

    def critic_law(self) -> Critic | None:
        """Return a critic law of the user's own, or None for the one that the settings name."""
        ...


class LearnedPolicy:
    """The learner's policy, which learns whenever its period has passed.

    Parameters
    ----------
    scenario : problem, basis, learner and samples
    learn : False keeps the initial weights (with the default ones, the policy -R^-1 g(ζ)'P ζ); with a
        safeguard, only from where they are predicted to cost less than the reference weights and the
        linear H-infinity policy

    Attributes
    ----------
    learner : the actor-critic
    period : time between learning steps [s]
    certify : whether frozen weights are certified
    zeta : (n,) the last state
    u_control, u_disturbance : (k,) û_1 and û_2 there, or at the mean state of the period (`MeanState`)
    last_step : what the last learning step saw; None where the last step did not learn
    """

    def __init__(self, scenario: LearnerScenario, *, learn: bool = True) -> None:
        setup = scenario.setup()
        self.learn = learn
        reference, weights = _start(scenario, setup)
        points = fixed_points(scenario.samples, setup)
        self.learner = Learner(
            setup.problem,
            setup.basis,
            scenario.learner,
            points if learn else points[:0],
            reference,
            weights,
            setup.functions,
            scenario.samples,
            setup.envelope if learn and scenario.samples.remember else None,
            scenario.critic_law(),
        )
        # nothing to certify where the frozen weights are the reference's own
        safeguarded = not learn and scenario.learner.safeguard
        self.certify = safeguarded and weights is not None and weights is not reference
        # now, not in the first step
        if learn or self.certify:
            list(self.learner.build())
        else:
            self.learner.policies(np.zeros(setup.problem.n_states))
        self.period = learning_period(setup.problem, scenario.learner)
        self._since: float | None = None
        self._mean_state = MeanState(setup.problem)
        self.last_step: LearnerStep | None = None
        self.zeta = np.zeros(setup.problem.n_states)
        self.u_control = np.zeros(setup.problem.n_inputs)
        self.u_disturbance = np.zeros(len(setup.game.W_d))

    @property
    def learned(self) -> LearnedPolicy:
        """The policy itself, where a vehicle's controller has one inside."""
        return self

    def step(self, zeta: Array, dt: float, *, learn: bool = True) -> Array:
        """Return û_1 at ζ (n,) to hold for dt [s], shape (k,).

        Learns at the first call, and then whenever `period` has passed since it last did. Where weights
        give what is not finite it is the linear H-infinity policy's.

        Parameters
        ----------
        learn : False learns nothing from this state, from which a safeguard still chooses the policy

        Raises
        ------
        InputError
            If ζ is not n finite numbers in the domain, or dt no positive time; nothing changes.
        """
        if not (isinstance(zeta, np.ndarray) and zeta.shape == self.zeta.shape):
            zeta = self.learner.problem.require_state(zeta)
        if not math.isfinite(sum(zeta.tolist())):
            zeta = self.learner.problem.require_state(zeta)
        if not (isinstance(dt, float) and 0.0 < dt < math.inf):
            dt = require_time_step(dt)
        seen, since = None, self.period if self._since is None else self._since + dt
        if since >= self.period * (1.0 - 1e-9) and (self.learn or self.certify):
            seen, since = self._learned(zeta, since, learn=learn), 0.0
        mean = self._mean_state(zeta, dt)
        u_control, u_disturbance = self.learner.policies(mean)
        if not math.isfinite(sum(u_control.tolist()) + sum(u_disturbance.tolist())):
            K_1, K_2 = self.learner.problem.linear_gains
            u_control, u_disturbance = -K_1 @ mean, K_2 @ mean
        self.zeta, self.last_step, self._since = zeta, seen, since
        self.u_control, self.u_disturbance = u_control, u_disturbance
        return u_control

    def _learned(self, zeta: Array, since: float, *, learn: bool) -> LearnerStep | None:
        """Learn or certify at ζ (n,), and return what was seen."""
        if not self.learn:
            return self.learner.certify(zeta)
        if learn:
            return self.learner.step(zeta, since)
        self.learner.keep(zeta)
        return None


def _start(scenario: LearnerScenario, setup: Setup) -> tuple[Array, Array | None]:
    """Return the reference weights, and those to start from, or None for the settings' multiple."""
    weights, settings = scenario.initial_weights(), scenario.learner
    if settings.reference == "riccati":
        return setup.riccati_weights, weights
    start = setup.riccati_weights * settings.weight_factor if weights is None else weights
    if not np.any(start):
        raise InputError(
            "learner.reference is 'initial', but the initial weights are zero, which leaves the "
            'projection a ball without points; set learner.reference = "riccati" or start elsewhere'
        )
    return start, start


def fixed_points(settings: SampleSettings, setup: Setup) -> Array:
    """Return the fixed ζ_j of (18), in the envelope, shape (N, n)."""
    return draw_samples(setup.envelope, settings.number, settings.seed, inner=settings.inner)
