"""What the paper asks of a vehicle: the pitch of Assumption 1, the inertia of Property 1, the trim."""

from __future__ import annotations

import numpy as np

from ...online.vehicle import shown_trim, trim_share
from ...symbolic import StationKeeping
from .condition import Condition


def vehicle_conditions(station: StationKeeping, pitch_limit: float) -> list[Condition]:
    """Return Assumption 1, Property 1 and the trim of a vehicle whose runs end at a pitch [deg]."""
    return [_pitch(pitch_limit), *_inertia(station, pitch_limit), *trim_condition(station)]


def _pitch(limit: float) -> Condition:
    return Condition(
        "pitch stays away from ±90 deg",
        "Assumption 1",
        limit,
        90.0,
        limit < 90.0,
        "deg; a run ends when |pitch| exceeds the limit",
    )


def _inertia(station: StationKeeping, limit: float) -> list[Condition]:
    low, high = inertia_bounds(station, np.radians(limit))
    where = f"over |pitch| <= {limit:g} deg and all rolls"
    return [
        Condition(
            "M_bar >= m_lower > 0",
            "Property 1",
            low,
            0.0,
            low > 0.0,
            f"smallest eigenvalue of M_bar {where}; not constant as printed: 0 at 90 deg",
        ),
        Condition(
            "M_bar <= m_upper",
            "Property 1",
            high,
            None,
            bool(np.isfinite(high)),
            f"largest eigenvalue of M_bar {where}; |g| <= 1/m_lower = {1.0 / low:.3g} there",
        ),
    ]


def inertia_bounds(station: StationKeeping, pitch_limit: float) -> tuple[float, float]:
    """Return the least and largest eigenvalue of M_bar over |θ| <= pitch_limit [rad] and all rolls.

    On a grid of 61 pitches and 48 rolls; M_bar turns with the yaw, which leaves its eigenvalues alone.
    """
    kernel = station.model.earth_frame
    low, high = np.inf, 0.0
    zeta = np.zeros(12)
    for theta in np.linspace(-pitch_limit, pitch_limit, 61):
        for phi in np.linspace(-np.pi, np.pi, 48, endpoint=False):
            zeta[3:5] = phi, theta
            eigenvalues = np.linalg.eigvalsh(kernel(zeta)[0])
            low, high = min(low, float(eigenvalues[0])), max(high, float(eigenvalues[-1]))
    return low, high


def trim_condition(station: StationKeeping) -> list[Condition]:
    """Return whether the thrusters can hold the vehicle at its station; nothing without thrusters."""
    share = trim_share(station)
    if share is None:
        return []
    return [
        Condition(
            "the thrusters can hold the trim",
            "not in the paper",
            share,
            1.0,
            share < 1.0,
            f"least share of their limits that gives u_trim = {shown_trim(station)}; the rest is left "
            "for control",
        )
    ]


def vehicle_equilibrium(station: StationKeeping) -> Condition:
    """Return Assumption 2, f(0) = 0, of a vehicle before its trim is taken out."""
    residual = float(np.linalg.norm(station.model.drift(np.zeros(12))))
    trim = np.array2string(station.model.u_trim, precision=3, suppress_small=True)
    note = "|f(0)|; neutrally buoyant, upright at rest"
    if residual >= 1e-9:
        note = f"|f(0)|; the steady trim u_trim = {trim} N, N m is fed forward and taken out of f"
    return Condition("f(0) = 0", "Assumption 2", residual, 0.0, residual < 1e-9, note)
