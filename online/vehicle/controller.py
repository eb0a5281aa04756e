"""The controller a user steps in a loop of their own."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...symbolic import InputError, RunError, StationKeeping
from ...symbolic.arrays import Array
from ..learning import Learner, LearnerStep
from ..loop import LearnedPolicy, LearnerScenario
from .allocation import require_trim
from .measurement import Flags, Limits, MeasurementGate, require_dt, require_measurement, tell
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

    What can't be a measurement is refused, and a refused call changes nothing. What a vehicle does not
    do is answered within limits and flagged; h are the half-widths of the scenario's envelope, χ is
    `simulation.chi`:

    - `gap`: dt is longer than the linearised loop stays stable under a held wrench, at most 1 s. It
      counts as that long, and angles are written the short way anew.
    - `jump`: the pose is more than h from where the rates lead, or a rate 2 h from the last one. The
      new pose holds, angles are written the short way anew, and nothing is learned from it.
    - `far`: the position is more than χ h from the station. The policy sees it there, χ h away in its
      direction, so that the wrench is bounded, and nothing is learned.
    - `rate`: the velocity or the angular rate is more than χ h, and likewise seen as χ h.
    - `rollback`: a learning step would have left weights or information not finite, and was not taken.

    A controller shares nothing that changes with any other; controllers of one scenario may run in
    threads of their own. One controller belongs to one thread at a time.

    Parameters
    ----------
    scenario : vehicle, game, basis, learner and samples
    station : x, y, z [m] and heading ψ [rad] to hold, in the earth frame
    learn : False keeps the initial weights (with the default ones, the policy -R^-1 g(ζ)'P ζ); with a
        safeguard, only from where they are predicted to cost less than the reference weights and the
        linear H-infinity policy
    limits : where measurements are flagged; those of vehicle and game, χ and pitch of the scenario's
        simulation, if None

    Attributes
    ----------
    learned : the learner's policy in the station's frame
    limits : up to where a measurement is taken as it is
    flags : of the last step that was answered, empty for an ordinary one
    counts : how many steps have had each flag; logged at 1, 10, 100, ...
    zeta : (12,) the last state, measured pose error and rates in the station's frame

    Examples
    --------
    >>> controller = Controller(Scenario.load("bluerov2-heavy"), station=(0, 0, 5, 0))
    >>> tau_b = controller.step(eta, eta_dot, dt=0.02)
    """

    def __init__(
        self,
        scenario: ControllerScenario,
        station: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
        *,
        learn: bool = True,
        limits: Limits | None = None,
    ) -> None:
        self.station = _station(station)
        self.setup = scenario.station_keeping()
        require_trim(self.setup)
        c, s = np.cos(self.station[3]), np.sin(self.station[3])
        self._turn = np.eye(12)
        self._turn[:2, :2] = self._turn[6:8, 6:8] = [[c, s], [-s, c]]
        self._origin = np.zeros(12)
        self._origin[[0, 1, 2, 5]] = self.station
        if self.station[3] != 0.0 and any(self.setup.model.current):
            raise InputError(
                "a known current can't be combined with a station heading other than 0; turn the "
                "earth frame so that its x axis is the heading to hold, and the current with it"
            )
        self.learned = LearnedPolicy(scenario, learn=learn)
        run = scenario.simulation
        self.limits = Limits.of(self.setup, run.chi, run.pitch_limit) if limits is None else limits
        self.flags: Flags = ()
        self.counts: Counter[str] = Counter()
        self.zeta = np.zeros(12)
        self._J = np.eye(6)
        self._gate = MeasurementGate(self.setup, self.limits)
        # built now, not in the first step
        self._u_trim, self._kinematics = self.setup.model.u_trim, self.setup.model.kinematics

    @property
    def pitch_limit(self) -> float:
        """The pitch up to which it holds the vehicle [deg]."""
        return self.limits.pitch

    @property
    def learner(self) -> Learner:
        """The actor-critic."""
        return self.learned.learner

    @property
    def last_step(self) -> LearnerStep | None:
        """What the last learning step saw; None where the last step did not learn."""
        return self.learned.last_step

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
            If pose and rate are not six finite numbers each, of a size that can be measured, dt is no
            positive time, or the pitch is beyond its limit.
        RunError
            If the wrench is not finite.
        """
        measured, dt = require_measurement(eta, eta_dot), require_dt(dt)
        seen = self._gate.look(self._error(measured), dt)
        u_control = self.learned.step(seen.policy, seen.dt, learn=seen.teaches)
        (J,) = self._kinematics(seen.zeta[:6])
        tau_b = np.asarray(J.T @ (u_control + self._u_trim))
        if not math.isfinite(sum(tau_b.tolist())):
            raise RunError("the wrench is not finite; start from other weights")
        self._gate.keep(seen)
        self.zeta, self._J = seen.zeta, J
        last = self.learned.last_step
        rolled_back = last is not None and last.rolled_back
        if seen.flags or rolled_back or self.flags:
            self.flags = (*seen.flags, *(("rollback",) if rolled_back else ()))
            self.counts.update(self.flags)
            tell(self.counts, seen.flags)
        return tau_b

    def body_wrench(self, u: Array) -> Array:
        """Return τ = J(η)'u of an earth-frame force u at the last state, shape (6,)."""
        return np.asarray(self._J.T @ u)

    def _error(self, measured: Array) -> Array:
        """Return the state relative to the station, in a frame turned by the station's heading.

        The dynamics don't depend on where north is, so the learned policy holds at every heading.
        """
        zeta: Array = self._turn @ (measured - self._origin)
        zeta[5] = math.atan2(math.sin(zeta[5]), math.cos(zeta[5]))  # with the rounding of all records
        return zeta


def _station(station: Sequence[float]) -> Array:
    """Return the station (4,); raises InputError unless it is four finite numbers."""
    try:
        given = np.array(station, dtype=float)
    except (TypeError, ValueError):
        given = np.zeros(0)
    if given.shape != (4,) or not np.isfinite(given).all():
        raise InputError(f"the station is {station}, but must be four finite numbers x, y, z, psi")
    if abs(given[3]) > 2.0 * math.pi:
        raise InputError(
            f"the station's heading is {given[3]:g} rad, more than a whole turn; angles are in rad"
        )
    return given
