"""A plant of one's own: an inverted pendulum with a bound on its angle.

    φ_ddot = (g / l) sin φ - (b / m l^2) φ_dot + (τ_1 + τ_2) / (m l^2)

`stationkeep compare examples/own_plant.py:problem` does all that follows, and draws it.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX
from stationkeep import Game, Problem, Scenario, simulate, solve
from stationkeep.online import LearnedPolicy
from stationkeep.symbolic import Bound

GRAVITY, LENGTH, MASS, FRICTION = 9.81, 0.5, 0.4, 0.02  # m/s^2, m, kg, N m s/rad
INERTIA = MASS * LENGTH**2  # kg m^2
START = np.array([0.6, 0.0])


def problem() -> Problem:
    """Return the pendulum, upright at the origin, and the game of holding it there."""
    zeta = SX.sym("zeta", 2)
    phi, rate = zeta[0], zeta[1]
    torque = MASS * GRAVITY * LENGTH * casadi.sin(phi) - FRICTION * rate
    sentence = "the angle is {} rad, but must stay within 1.5 rad of upright; start closer"
    return Problem(
        name="inverted pendulum",
        zeta=zeta,
        drift=casadi.vertcat(rate, torque / INERTIA),
        control_matrix=casadi.vertcat(SX(0), 1 / INERTIA),
        game=Game(np.array([4.0, 0.2]), np.array([0.5]), np.array([0.5]), gamma=3.0),
        scale=np.array([0.8, 3.0]),
        state_names=("phi", "phi_dot"),
        state_units=("rad", "rad/s"),
        input_names=("torque",),
        input_units=("N m",),
        domain=(Bound(1.5**2 - phi**2, sentence, shown=phi),),
    )


def main() -> tuple[float, float]:
    """Return the certified least cost from a tilt, and what a learner pays that learns on the way."""
    optimum = solve(problem(), START)
    print(f"optimum {optimum.value:.6f}, relative error {optimum.certificate.value_error:.1e}")
    scenario = Scenario.load(f"{__file__}:problem")
    run = simulate(problem(), LearnedPolicy(scenario), START, duration=5.0, control_period=0.01)
    cost = float(run["cost"][-1] - run["attenuated"][-1])
    print(f"learned {cost:.6f}, {100 * (cost / optimum.value - 1):.2f} % more")
    return optimum.value, cost


if __name__ == "__main__":
    main()
