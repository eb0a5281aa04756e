"""The controller a user steps in a loop of their own."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...symbolic import InputError, StationKeeping
from ...symbolic.arrays import Array
from ...symbolic.game import AngleTracker
from ...symbolic.underwater import require_pitch_within
from ..learning import Learner, LearnerStep
from ..loop import LearnedPolicy, LearnerScenario
from .settings import SimulationSettings


class ControllerScenario(LearnerScenario, Protocol):
    """What a controller needs of a scenario."""

    @property
    def simulation(self) -> SimulationSettings:
        """Settings of a run, whose pitch limit the controller keeps to."""
        ...

    def station_keeping(self) -> StationKeeping:
        """Return vehicle, game and basis."""
        ...


class Controller:
    """Hold a vehicle at a station and learn to do it better.

    An attitude is one thing however it is written: the first measurement is taken the short way from
    the station, further ones as they continue it (`AngleTracker`).

    Parameters
    ----------
    scenario : vehicle, game, basis, learner and samples
    station : x, y, z [m] and heading ψ [rad] to hold, in the earth frame
    learn : False keeps the initial weights (with the default ones, the policy -R^-1 g(ζ)'P ζ); with a
        safeguard, only from where they are predicted to cost less than the reference weights and the
        linear H-infinity policy

    Attributes
    ----------
    learned : the learner's policy in the station's frame
    pitch_limit : of the pitch up to which it holds the vehicle [deg], `simulation.pitch_limit`

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
        self.learned = LearnedPolicy(scenario, learn=learn)
        self._J = np.eye(6)
        self.pitch_limit = scenario.simulation.pitch_limit
        self._angles = AngleTracker(self.setup.problem.angles)

    @property
    def learner(self) -> Learner:
        """The actor-critic."""
        return self.learned.learner

    @property
    def last_step(self) -> LearnerStep | None:
        """What the last learning step saw; None where the last step did not learn."""
        return self.learned.last_step

    @property
    def zeta(self) -> Array:
        """The last state, (12,): pose error and rates in the station's frame."""
        return self.learned.zeta

    @property
    def u_control(self) -> Array:
        """û_1 there, (6,) [N, N m]."""
        return self.learned.u_control

    @property
    def u_disturbance(self) -> Array:
        """û_2 there, (6,) [N, N m]."""
        return self.learned.u_disturbance

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
            If the measurement is not finite or of the wrong shape, or the pitch is beyond its limit.
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
        zeta = self._error(measured)
        require_pitch_within(float(zeta[4]), self.pitch_limit)
        (self._J,) = self.setup.model.kinematics(zeta[:6])
        u_control = self.learned.step(zeta, dt)
        return self.body_wrench(u_control + self.setup.model.u_trim)

    def body_wrench(self, u: Array) -> Array:
        """Return τ = J(η)'u of an earth-frame force u at the last state, shape (6,)."""
        return np.asarray(self._J.T @ u)

    def _error(self, measured: Array) -> Array:
        """Return the state relative to the station, in a frame turned by the station's heading.

        The dynamics don't depend on where north is, so the learned policy holds at every heading.
        """
        zeta: Array = self._turn @ (measured - self._origin)
        zeta[5] = math.atan2(math.sin(zeta[5]), math.cos(zeta[5]))  # with the rounding of all records
        return self._angles.enter(zeta)
