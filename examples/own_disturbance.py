"""Disturbances of one's own: a source for a vehicle's run, and a function d(t, ζ) for any problem.

A tether, unknown to the controller, pulls the vehicle towards its anchor. A wave pushes a mass, which a
linear policy holds as a spring and a damper would.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from stationkeep import Controller, Scenario, simulate
from stationkeep.online import run
from stationkeep.online.vehicle import Disturbance
from stationkeep.symbolic.textbook import double_integrators

Array = NDArray[np.float64]
STIFFNESS, ANCHOR = 4.0, np.array([2.0, -1.0, 0.0])  # N/m, m from the station
AMPLITUDE, OMEGA = 0.3, 2.0  # N, rad/s


class Tether:
    """A spring from the vehicle's origin to a point in the water."""

    breaks: tuple[float, ...] = ()  # smooth in time
    steady = False  # depends on where the vehicle is

    def at(self, t: float, position: Array) -> Disturbance:
        """Return the force at time t [s] and earth-frame position (3,) [m] from the station."""
        force = np.append(STIFFNESS * (ANCHOR - position), np.zeros(3))
        return Disturbance(force, water_velocity=np.zeros(3), water_acceleration=np.zeros(3))


def tethered() -> Array:
    """Return where the linear policy lets the tether pull the vehicle, (12,)."""
    settings = ("basis.name=quadratic", "simulation.mode=disturbed", "simulation.duration=60")
    scenario = Scenario.load("bluerov2-heavy", [*settings, "samples.number=0"])
    return run(scenario, Controller(scenario, learn=False), source=Tether()).zeta[-1]


def pushed() -> float:
    """Return the amplitude [m] of a mass under the linear policy and the wave."""
    mass = double_integrators(1)
    K, _ = mass.linear_gains

    def wave(t: float, zeta: Array) -> Array:
        return np.array([AMPLITUDE * np.sin(OMEGA * t)])

    record = simulate(mass, lambda z: -K @ z, [0.0, 0.0], 40.0, mode="disturbed", disturbance=wave)
    return float(np.abs(record["zeta"].values[-400:, 0]).max())


def main() -> tuple[Array, float]:
    """Return where the vehicle ends and how far the mass swings."""
    end, amplitude = tethered(), pushed()
    print(f"the tether holds the vehicle at {end[:3].round(4)} m; the mass swings {amplitude:.4f} m")
    return end, amplitude


if __name__ == "__main__":
    main()
