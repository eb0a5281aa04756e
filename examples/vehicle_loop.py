"""A vehicle's loop of one's own at 50 Hz: the controller, and a plant that one integrates oneself.

The vehicle is 1 N heavier than the water it displaces; the station is 5 m deep, bow to the south-west.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from stationkeep import Controller, Scenario

Array = NDArray[np.float64]
STATION = (10.0, -4.0, 5.0, np.radians(-135.0))  # x, y, z [m], heading [rad]
PERIOD, DURATION = 0.02, 30.0  # s


def main() -> tuple[Array, Array]:
    """Return the pose relative to the station and the wrench that the run ends with."""
    scenario = Scenario.load("bluerov2-heavy-buoyant", ["basis.name=quadratic"])
    controller = Controller(scenario, station=STATION)
    plant = controller.setup.model.plant
    none = (np.zeros(6), np.zeros(3), np.zeros(3))  # no other wrench, still water

    def rate(zeta: Array, tau_b: Array) -> Array:
        return np.asarray(plant(zeta, tau_b, *none)[0])

    target = np.array([*STATION[:3], 0.0, 0.0, STATION[3]])
    zeta = np.concatenate([target + np.array([0.6, -0.4, 0.3, 0.1, 0.0, 0.5]), np.zeros(6)])
    for i in range(round(DURATION / PERIOD)):
        tau_b = controller.step(zeta[:6], zeta[6:], PERIOD)  # measured pose and its rate
        k1 = rate(zeta, tau_b)
        k2 = rate(zeta + 0.5 * PERIOD * k1, tau_b)
        k3 = rate(zeta + 0.5 * PERIOD * k2, tau_b)
        k4 = rate(zeta + PERIOD * k3, tau_b)
        zeta = zeta + PERIOD / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if i % 250 == 0:
            print(f"t = {i * PERIOD:4.1f} s: {np.linalg.norm(zeta[:3] - target[:3]):.4f} m away")
    print("pose error", (zeta[:6] - target).round(5), "wrench", tau_b.round(4))
    return zeta[:6] - target, tau_b


if __name__ == "__main__":
    main()
