"""Disturbances d(t) of the `disturbed` mode: forces on the vehicle, currents and waves.

Water moves the vehicle through its relative velocity (see `symbolic.dynamics`); a force acts as
τ_bar_d of (2) in the earth frame. The controller knows none of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import casadi
import numpy as np
from casadi import DM, SX

from ...symbolic.arrays import Array
from .settings import DisturbanceSettings

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True)
class Disturbance:
    """A disturbance at one instant.

    Attributes
    ----------
    force : (6,) in the earth frame [N, N m]
    water_velocity : (3,) in the earth frame [m/s]
    water_acceleration : (3,) in the earth frame [m/s^2]
    """

    force: Array
    water_velocity: Array
    water_acceleration: Array


class DisturbanceSource(Protocol):
    """d(t) at a position.

    Attributes
    ----------
    breaks : times at which it is not smooth
    steady : whether it is constant between them, wherever the vehicle is
    """

    breaks: tuple[float, ...]
    steady: bool

    def at(self, t: float, position: Array) -> Disturbance:
        """Return the disturbance at time t [s] and earth-frame position (3,) [m] from the station."""
        ...


class KnownSource(DisturbanceSource, Protocol):
    """A source that also gives d(t) at a position as an expression, to be differentiated."""

    def expression(self, t: SX, position: SX) -> tuple[SX, SX, SX]:
        """Return `at` as expressions: force (6,), water velocity (3,) and acceleration (3,).

        Parameters
        ----------
        t : scalar [s]
        position : (3,) in the earth frame, from the station [m]
        """
        ...


class Force:
    """A constant or sinusoidal force, amplitude · sin(2π f (t - start)), from `start` on."""

    def __init__(self, amplitude: Array, frequency: float, start: float) -> None:
        self.amplitude, self.frequency, self.start = amplitude, frequency, start
        self.breaks: tuple[float, ...] = (start,) if np.any(amplitude) else ()
        self.steady = frequency == 0.0
        self._still = np.zeros(3)

    def at(self, t: float, position: Array) -> Disturbance:
        """Return the force at time t; a frequency of 0 is a constant force."""
        factor = 1.0 if t >= self.start else 0.0
        if not self.steady:
            factor *= math.sin(2.0 * np.pi * self.frequency * (t - self.start))
        return Disturbance(factor * self.amplitude, self._still, self._still)

    def expression(self, t: SX, position: SX) -> tuple[SX, SX, SX]:
        """Return the force at time t as an expression; the water is still."""
        factor = SX(t >= self.start)
        if not self.steady:
            factor *= casadi.sin(2.0 * np.pi * self.frequency * (t - self.start))
        return factor * DM(self.amplitude), SX(3, 1), SX(3, 1)


class CurrentStep:
    """Water that moves at a constant velocity from `start` on."""

    def __init__(self, velocity: Array, start: float) -> None:
        self.velocity, self.start = velocity, start
        self.breaks: tuple[float, ...] = (start,)
        self.steady = True

    def at(self, t: float, position: Array) -> Disturbance:
        """Return the current at time t; the step's infinite acceleration is left out."""
        return Disturbance(np.zeros(6), (t >= self.start) * self.velocity, np.zeros(3))

    def expression(self, t: SX, position: SX) -> tuple[SX, SX, SX]:
        """Return the current at time t as an expression."""
        return SX(6, 1), SX(t >= self.start) * DM(self.velocity), SX(3, 1)


def jonswap(omega: Array, height: float, period: float, peak_enhancement: float = 3.3) -> Array:
    """Return the JONSWAP spectrum S(ω) [m^2 s], scaled so that its integral is H_s^2 / 16.

    S ∝ ω^-5 exp(-5/4 (ω_p/ω)^4) γ^exp(-(ω - ω_p)^2 / (2 σ^2 ω_p^2)), σ = 0.07 below the peak ω_p and
    0.09 above (Hasselmann et al. 1973).

    Parameters
    ----------
    omega : ascending frequencies [rad/s]
    height : significant wave height H_s [m]
    period : peak period T_p [s]
    """
    peak = 2.0 * np.pi / period
    width = np.where(omega <= peak, 0.07, 0.09)
    bump = np.exp(-((omega - peak) ** 2) / (2.0 * (width * peak) ** 2))
    shape = omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4) * peak_enhancement**bump
    return np.asarray(shape * (height**2 / 16.0) / np.trapezoid(shape, omega))


class Waves:
    """Irregular long-crested waves in deep water, as a sum of Airy waves with seeded phases.

    Orbital velocity a ω e^{-k z}, k = ω^2 / g, at the vehicle's depth z and horizontal position; the
    frequencies are slightly irregular, so that the record does not repeat.
    """

    breaks: tuple[float, ...] = ()
    steady = False

    def __init__(self, settings: DisturbanceSettings, n_components: int = 60) -> None:
        rng = np.random.default_rng(settings.seed)
        peak = 2.0 * np.pi / settings.wave_period
        edges = np.linspace(0.5 * peak, 3.0 * peak, n_components + 1)
        fine = np.linspace(edges[0], edges[-1], 20 * n_components + 1)
        spectrum = jonswap(fine, settings.wave_height, settings.wave_period, settings.peak_enhancement)
        variance = [
            np.trapezoid(spectrum[20 * i : 20 * i + 21], fine[20 * i : 20 * i + 21])
            for i in range(n_components)
        ]
        self.amplitude = np.sqrt(2.0 * np.array(variance))
        self.omega = rng.uniform(edges[:-1], edges[1:])
        self.wavenumber = self.omega**2 / GRAVITY
        self.phase = rng.uniform(0.0, 2.0 * np.pi, n_components)
        heading = np.radians(settings.wave_heading)
        self.direction = np.array([np.cos(heading), np.sin(heading)])
        self.depth = settings.depth

    def at(self, t: float, position: Array) -> Disturbance:
        """Return orbital velocity and acceleration at time t and the position's depth."""
        along = self.direction @ position[:2]
        angle = self.wavenumber * along - self.omega * t + self.phase
        depth = max(self.depth + position[2], 0.0)
        speed = self.amplitude * self.omega * np.exp(-self.wavenumber * depth)
        horizontal, down = speed @ np.cos(angle), -(speed @ np.sin(angle))
        rate = speed * self.omega
        horizontal_rate, down_rate = rate @ np.sin(angle), rate @ np.cos(angle)
        return Disturbance(
            np.zeros(6),
            np.append(horizontal * self.direction, down),
            np.append(horizontal_rate * self.direction, down_rate),
        )

    def expression(self, t: SX, position: SX) -> tuple[SX, SX, SX]:
        """Return orbital velocity and acceleration as expressions; no force."""
        along = DM(self.direction).T @ position[:2]
        angle = DM(self.wavenumber) * along - DM(self.omega) * t + DM(self.phase)
        depth = casadi.fmax(self.depth + position[2], 0.0)
        speed = DM(self.amplitude * self.omega) * casadi.exp(-DM(self.wavenumber) * depth)
        rate, cosine, sine = speed * DM(self.omega), casadi.cos(angle), casadi.sin(angle)
        return (
            SX(6, 1),
            casadi.vertcat(DM(self.direction) * casadi.dot(speed, cosine), -casadi.dot(speed, sine)),
            casadi.vertcat(DM(self.direction) * casadi.dot(rate, sine), casadi.dot(rate, cosine)),
        )


def build_disturbance(settings: DisturbanceSettings) -> KnownSource:
    """Return the source that the settings describe."""
    if settings.kind == "current":
        return CurrentStep(np.array(settings.velocity), settings.start)
    if settings.kind == "waves":
        return Waves(settings)
    amplitude = np.zeros(6) if settings.kind == "none" else np.array(settings.force)
    frequency = settings.frequency if settings.kind == "sinusoid" else 0.0
    return Force(amplitude, frequency, settings.start)
