"""The controller a user steps in a loop of their own."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...symbolic import InputError, StationKeeping, require_pitch
from ...symbolic.arrays import Array
from ..learning import Learner, LearnerSettings, LearnerStep, SampleSettings
from ..rows import draw_samples


class ControllerScenario(Protocol):
    """What a controller needs of a scenario."""

    @property
    def learner(self) -> LearnerSettings:
        """Settings of the actor-critic."""
        ...

    @property
    def samples(self) -> SampleSettings:
        """Settings of the sample points."""
        ...

    def station_keeping(self) -> StationKeeping:
        """Return vehicle, game and basis."""
        ...

    def initial_weights(self) -> Array | None:
        """Return the weights to start from, or None for weight_factor times the Riccati weights."""
        ...


class Controller:
    """Hold a vehicle at a station and learn to do it better.

    Parameters
    ----------
    scenario : vehicle, game, basis, learner and samples
    station : x, y, z [m] and heading ψ [rad] to hold, in the earth frame
    learn : False keeps the initial weights (with the default ones, the policy -R^-1 g(ζ)'P ζ); with a
        safeguard, only from where they are predicted to cost less than the reference weights and the
        linear H-infinity policy

    Attributes
    ----------
    learner : the actor-critic
    zeta : (12,) the last state: pose error and rates in the station's frame
    u_control, u_disturbance : (6,) û_1 and û_2 there [N, N m]
    last_step : what the last learning step saw

    Examples
    --------
    >>> controller = Controller(Scenario.load("bluerov2-heavy"), station=(0, 0, 5, 0))
    >>> tau_b = controller.step(eta, eta_dot, dt=0.02)
    """

    def __init__(
        self,
        scenario: ControllerScenario,
        station: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
        *,
        learn: bool = True,
    ) -> None:
        if len(station) != 4 or not np.all(np.isfinite(station)):
            raise InputError(f"the station is {station}, but must be four finite numbers x, y, z, psi")
        self.setup = scenario.station_keeping()
        self.station = np.array(station, dtype=float)
        c, s = np.cos(station[3]), np.sin(station[3])
        self._turn = np.eye(12)
        self._turn[:2, :2] = self._turn[6:8, 6:8] = [[c, s], [-s, c]]
        self._origin = np.zeros(12)
        self._origin[[0, 1, 2, 5]] = self.station
        if station[3] != 0.0 and any(self.setup.model.current):
            raise InputError(
                "a known current can't be combined with a station heading other than 0; turn the "
                "earth frame so that its x axis is the heading to hold, and the current with it"
            )
        self.learn = learn
        reference, weights = _start(scenario, self.setup)
        self.learner = Learner(
            self.setup.problem,
            self.setup.basis,
            scenario.learner,
            fixed_points(scenario.samples, self.setup) if learn else np.zeros((0, 12)),
            reference,
            weights,
            self.setup.functions,
            scenario.samples,
            self.setup.envelope if learn and scenario.samples.remember else None,
        )
        # nothing to certify where the frozen weights are the reference's own
        safeguarded = not learn and scenario.learner.safeguard
        self.certify = safeguarded and weights is not None and weights is not reference
        self.period = scenario.learner.period
        self._since: float | None = None
        self.last_step: LearnerStep | None = None
        self.zeta, self._J = np.zeros(12), np.eye(6)
        self.u_control = np.zeros(6)
        self.u_disturbance = np.zeros(6)

    def step(self, eta: ArrayLike, eta_dot: ArrayLike, dt: float) -> Array:
        """Return the body wrench τ_b = J'(û_1 + u_trim) to hold for the next dt, shape (6,) [N, N m].

        Learns at the first call, and then whenever `period` has passed since it last did.

        Parameters
        ----------
        eta : (6,) measured pose in the earth frame [m, rad]
        eta_dot : (6,) its rate [m/s, rad/s]
        dt : time since the last call, which is also how long τ_b is held [s]

        Raises
        ------
        InputError
            If the measurement is not finite or of the wrong shape, or |pitch| >= 90 degrees.
        """
        try:
            pose, rate = np.asarray(eta, dtype=float), np.asarray(eta_dot, dtype=float)
        except (TypeError, ValueError):
            raise InputError("eta and eta_dot must be 6 numbers each") from None
        if not (dt > 0.0 and math.isfinite(dt)):
            raise InputError(f"dt is {dt}, but must be a positive time in seconds")
        if pose.shape != (6,) or rate.shape != (6,):
            raise InputError(
                f"eta and eta_dot must have 6 entries each, but have {pose.shape} and {rate.shape}"
            )
        measured = np.concatenate((pose, rate))
        if not np.isfinite(measured).all():
            raise InputError("eta and eta_dot must be finite, but contain NaN or infinity")
        require_pitch(pose[4])
        self.zeta = self._error(measured)
        (self._J,) = self.setup.model.kinematics(self.zeta[:6])
        self.last_step = None
        since = self.period if self._since is None else self._since + dt
        if self.learn and since >= self.period * (1.0 - 1e-9):
            self.last_step = self.learner.step(self.zeta, since)
            since = 0.0
        elif self.certify and since >= self.period * (1.0 - 1e-9):
            self.last_step = self.learner.certify(self.zeta)
            since = 0.0
        self._since = since
        self.u_control, self.u_disturbance = self.learner.policies(self.zeta)
        return self.body_wrench(self.u_control + self.setup.model.u_trim)

    def body_wrench(self, u: Array) -> Array:
        """Return τ = J(η)'u of an earth-frame force u at the last state, shape (6,)."""
        return np.asarray(self._J.T @ u)

    def _error(self, measured: Array) -> Array:
        """Return the state relative to the station, in a frame turned by the station's heading.

        The dynamics don't depend on where north is, so the learned policy holds at every heading.
        """
        zeta: Array = self._turn @ (measured - self._origin)
        zeta[5] = math.atan2(math.sin(zeta[5]), math.cos(zeta[5]))
        return zeta


def _start(scenario: ControllerScenario, setup: StationKeeping) -> tuple[Array, Array | None]:
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


def fixed_points(settings: SampleSettings, setup: StationKeeping) -> Array:
    """Return the fixed ζ_j of (18), in the envelope, shape (N, 12)."""
    return draw_samples(setup.envelope, settings.number, settings.seed, inner=settings.inner)
