"""What is taken of a measurement: refused, limited and flagged, or as it is, by stated rules.

Refused, with one sentence, and nothing is kept of it: what is not six and six finite numbers of less
than 1e9, a dt that is no positive time, a pitch beyond its limit. Everything else is answered. With h
the half-widths of the full envelope, these are flagged:

- `gap`: dt is longer than the linearised loop stays stable under a held wrench (`longest_hold`), and at
  most 1 s. No policy that is held so long holds a vehicle. It counts as that longest time, and what was
  followed from step to step begins anew: the turn of the angles, the acceleration.
- `jump`: the pose is more than h from where the mean of the rates leads from the last one, or a rate is
  more than 2 h from the last, the whole width of the envelope. A vehicle does not move so; its position
  was set anew, or a sensor failed. The new pose holds, what was followed begins anew.
- `far`: the position is beyond χ of its half-widths, where predictions end and a simulated run counts
  as lost. The policy sees it pulled in to there, along its direction.
- `rate`: the same of the velocities, or of the angular rates.

After a jump, and from what is limited, nothing is learned.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...symbolic import InputError, StationKeeping
from ...symbolic.arrays import Array
from ...symbolic.errors import is_told
from ...symbolic.game import AngleTracker, longest_hold, require_time_step
from ...symbolic.underwater import STATE_NAMES, require_pitch_within
from ...symbolic.value import BOUND

Flag = Literal["gap", "jump", "far", "rate", "rollback"]
Flags = tuple[Flag, ...]
TOLD: dict[Flag, str] = {
    "gap": "the last wrench was held for longer than it can be",
    "jump": "the measured state is not where the last one leads",
    "far": "the position is too far from the station, and the wrench limited",
    "rate": "a measured rate is too large, and the wrench limited",
}
LARGEST = 1e9  # of any measured number [m, rad, m/s, rad/s]
LONGEST_GAP = 1.0  # s
logger = logging.getLogger("stationkeep")
_GROUPS: tuple[tuple[slice, Flag], ...] = (
    (slice(0, 3), "far"),
    (slice(6, 9), "rate"),
    (slice(9, 12), "rate"),
)


@dataclass(frozen=True)
class Limits:
    """Up to where a measurement is taken as it is.

    Attributes
    ----------
    half_widths : (12,) h of the full envelope [m, rad, m/s, rad/s]
    far : χ, half-widths up to which position and rates are believed
    pitch : largest |pitch| that is answered [deg]
    gap : longest dt [s]
    """

    half_widths: Array
    far: float
    pitch: float
    gap: float

    @classmethod
    def of(cls, station: StationKeeping, far: float = BOUND, pitch: float = 75.0) -> Limits:
        """Return the limits of a vehicle and its game."""
        return cls(station.half_widths, far, pitch, longest_hold(station.problem, LONGEST_GAP))


class Seen(NamedTuple):
    """A measurement as it is taken.

    zeta : (12,) the state, its attitude as it continues the one before; policy : (12,) what the policy
    sees of it; dt : what counts of the time step [s]; flags : what is out of the ordinary
    """

    zeta: Array
    policy: Array
    dt: float
    flags: Flags

    @property
    def teaches(self) -> bool:
        """Whether a learner may learn from it: a gap is no fault of the state after it."""
        return self.flags in ((), ("gap",))


class MeasurementGate:
    """Measured states (12,), one after the other, under the rules.

    `look` judges and keeps nothing; `keep` keeps what was seen, once all that follows from it is done.
    """

    def __init__(self, station: StationKeeping, limits: Limits) -> None:
        self.limits = limits
        self._angles = AngleTracker(station.problem.angles)
        self._periods = np.array(station.problem.angles.periods)
        self._last: Array | None = None
        h = limits.half_widths
        self._per_width = 1.0 / h
        believed = [0, 1, 2, 6, 7, 8, 9, 10, 11]
        self._per_limit = np.zeros(12)
        self._per_limit[believed] = self._per_width[believed] / limits.far
        # within such a dt, rates that are believed lead less than h / 2 away
        self._short = min(float((h[:6] / h[6:]).min()) / (2.0 * limits.far + 1.0), limits.gap)
        self._level = 0.99 * math.radians(limits.pitch)

    def look(self, zeta: Array, dt: float) -> Seen:
        """Return how the state (12,), finite, dt [s] after the last one, is taken.

        Raises
        ------
        InputError
            If the pitch is beyond its limit.
        """
        last = self._last
        seen = self._angles.seen(zeta, anew=dt > self.limits.gap)
        scaled = seen * self._per_limit
        # what is far from all limits needs no closer look
        if scaled.dot(scaled) <= 1.0 and abs(seen[4]) <= self._level and dt <= self._short:
            moved = scaled if last is None else (seen - last) * self._per_width
            if moved.dot(moved) <= 0.25:
                return Seen(seen, seen, dt, ())
        return self._judged(zeta, seen, dt)

    def keep(self, seen: Seen) -> None:
        """Keep a measurement, for the next one to continue it."""
        self._last = seen.zeta
        self._angles.keep(seen.zeta)

    def _judged(self, zeta: Array, seen: Array, dt: float) -> Seen:
        flags: list[Flag] = []
        if self._last is None:
            pass
        elif dt > self.limits.gap:
            flags.append("gap")
        elif self._jumps(seen, self._last, dt):
            seen = self._angles.seen(zeta, anew=True)
            flags.append("jump")
        self._require_pitch(seen)
        policy = seen
        for group, flag in _GROUPS:
            beyond = float(np.abs(seen[group] / self.limits.half_widths[group]).max()) / self.limits.far
            if beyond > 1.0:
                policy = policy.copy() if policy is seen else policy
                policy[group] /= beyond
                flags += [flag] if flag not in flags else []
        return Seen(seen, policy, min(dt, self.limits.gap), tuple(flags))

    def _jumps(self, zeta: Array, last: Array, dt: float) -> bool:
        """Return whether a vehicle that was at `last` does not get to ζ within dt [s]."""
        led = zeta - last
        led[:6] -= 0.5 * dt * (zeta[6:] + last[6:])
        turning = self._periods > 0.0
        led[turning] -= np.round(led[turning] / self._periods[turning]) * self._periods[turning]
        widths = np.abs(led) / self.limits.half_widths
        return bool(widths[:6].max() > 1.0 or widths[6:].max() > 2.0)

    def _require_pitch(self, zeta: Array) -> None:
        require_pitch_within(float(zeta[4]), self.limits.pitch)


def require_measurement(eta: ArrayLike, eta_dot: ArrayLike) -> Array:
    """Return a measured pose and its rate as one array (12,).

    Raises
    ------
    InputError
        If they are not six finite numbers each, of a size that can be measured.
    """
    pose, rate = _numbers(eta), _numbers(eta_dot)
    if pose is None or rate is None:
        raise InputError("eta and eta_dot must be 6 numbers each")
    if pose.shape != (6,) or rate.shape != (6,):
        raise InputError(
            f"eta and eta_dot must have 6 entries each, but have {pose.shape} and {rate.shape}"
        )
    measured = np.concatenate((pose, rate))
    if not math.hypot(*measured.tolist()) <= LARGEST:  # written so that NaN is not accepted
        _require_sizes(measured, "eta and eta_dot")
    return measured


def require_state(zeta: ArrayLike) -> Array:
    """Return a copy of a measured state (12,); raises InputError as `require_measurement`."""
    state = _numbers(zeta)
    if state is None or state.shape != (12,):
        raise InputError(f"zeta must be 12 numbers ({','.join(STATE_NAMES)})")
    if not math.hypot(*state.tolist()) <= LARGEST:
        _require_sizes(state, "zeta")
    return state.copy()


def require_wrench(tau_b: ArrayLike) -> Array:
    """Return a copy of a body wrench (6,); raises InputError unless it is six finite numbers."""
    wrench = _numbers(tau_b)
    if wrench is None or wrench.shape != (6,) or not np.isfinite(wrench).all():
        raise InputError("tau_b must be 6 finite numbers, a body wrench in N and N m")
    return wrench.copy()


def require_dt(dt: float) -> float:
    """Return dt [s]; raises InputError unless it is a positive finite number."""
    return dt if isinstance(dt, float) and 0.0 < dt < math.inf else require_time_step(dt)


def tell(counts: Counter[str], flags: Flags) -> None:
    """Log flags as warnings, each the first, the 10th, the 100th, ... time."""
    for flag in flags:
        if is_told(counts[flag]):
            logger.warning("%s: %s (%d so far)", flag, TOLD[flag], counts[flag])


def _numbers(value: ArrayLike) -> Array | None:
    """Return numbers as an array of floats, or None for text, truth values and whatever else."""
    if isinstance(value, np.ndarray) and value.dtype.char == "d":
        return value
    try:
        given = np.asarray(value)
        return np.asarray(given, dtype=float) if given.dtype.kind in "fiuO" else None
    except (TypeError, ValueError):
        return None


def _require_sizes(measured: Array, name: str) -> None:
    if not np.isfinite(measured).all():
        raise InputError(f"{name} must be finite, but contain NaN or infinity")
    worst = int(np.abs(measured).argmax())
    if abs(measured[worst]) > LARGEST:
        raise InputError(
            f"{STATE_NAMES[worst]} is measured as {measured[worst]:g}, but no sensor gives more than "
            f"{LARGEST:g}; give poses in m and rad, rates in m/s and rad/s"
        )
