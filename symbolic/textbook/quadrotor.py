"""A quadrotor in a vertical plane that comes back to hover: two inputs for three degrees of freedom.

    m x_ddot     = -T sin(θ)
    m z_ddot     =  T cos(θ) - m g          T = m g + v_1
    I θ_ddot     =  M                       M = v_2

with the horizontal position x, the height z and the angle θ from the vertical to the thrust,
counter-clockwise; T is the thrust and M the moment of all rotors. In v = u_1 + u_2, the deviation from
hover, f(0) = 0 and both players enter through a g that turns with the vehicle:

    f = (x_dot, z_dot, θ_dot, -g sin(θ), g (cos(θ) - 1), 0)
    g = [0; 0; 0; -sin(θ)/m, 0; cos(θ)/m, 0; 0, 1/I]

It is the planar quadrotor of Tedrake, Underactuated Robotics (MIT), chapter 3, with the parameters of
a Crazyflie 2.0: m = 28 g, and I_yy = 16.655602e-6 kg m^2 as identified by Förster 2015, System
identification of the Crazyflie 2.0 nano quadrocopter, ETH Zürich. Left out: drag, and the rotors' lag
and limits. Optimal thrusts of the default game are mostly 0.6 to 1.5 times that of hover, but from
corners of the envelope they would have to be negative, or more than twice it.

There are no inverse dynamics. What linear policies don't know is that the thrust turns: tilted it
carries less, and how hard it pushes sideways depends on how much it carries.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX

from ..errors import InputError
from ..game import Bound, Game, Problem

GRAVITY = 9.81  # m/s^2
MASS = 0.028  # kg
INERTIA = 16.655602e-6  # kg m^2, about the pitch axis; Förster 2015
STATE_NAMES = ("x", "z", "theta", "x_dot", "z_dot", "theta_dot")
STATE_UNITS = ("m", "m", "rad", "m/s", "m/s", "rad/s")
HALF_WIDTHS = (1.5, 1.0, 0.6, 1.5, 1.0, 3.0)  # of the envelope, in the states' units
BRYSON = (0.5, 1.0, 1.0, 2.0, 2.0, 10.0)  # deviations of the states that cost 1 per second each
THRUST = 0.3  # deviation of the thrust that costs 1 per second, as a part of the weight
ACCELERATION = 50.0  # rad/s^2; so does the moment that gives this


def quadrotor(mass: float = MASS, inertia: float = INERTIA, gamma: float = 2.0) -> Problem:
    """Return the hover of a planar quadrotor: 6 states, 2 inputs (thrust [N], moment [N m]).

    Weights after Bryson: Q = diag(1/b_i^2) with the deviations b of `BRYSON`, R = diag(1/(0.3 m g)^2,
    1/(50 I)^2), W_d = R. So the linearised game and its P don't depend on mass and inertia.

    Parameters
    ----------
    mass : m [kg]
    inertia : I [kg m^2]
    gamma : attenuation level γ > 1 [-]

    Raises
    ------
    InputError
        If mass or inertia is not positive; GammaTooSmallError if γ <= 1.
    """
    for name, value, unit in (("mass", mass, "kg"), ("inertia", inertia, "kg m^2")):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"the {name} is {value:g}, but must be a positive number of {unit}")
    zeta = SX.sym("zeta", 6)
    theta = zeta[2]
    sine, cosine = casadi.sin(theta), casadi.cos(theta)
    drift = casadi.vertcat(zeta[3:], -GRAVITY * sine, GRAVITY * (cosine - 1), 0)
    control_matrix = SX(6, 2)
    control_matrix[3, 0], control_matrix[4, 0] = -sine / mass, cosine / mass
    control_matrix[5, 1] = 1 / inertia
    R = np.array([THRUST * mass * GRAVITY, ACCELERATION * inertia]) ** -2.0
    game = Game(np.array(BRYSON) ** -2.0, R, R, gamma)
    upright = Bound(
        (np.pi / 2) ** 2 - theta**2,
        "the angle theta is {} deg, but must stay inside ±90 deg, where the thrust no longer carries "
        "the weight; start closer to level",
        180.0 / np.pi * theta,
    )
    return Problem(
        "planar quadrotor",
        zeta,
        drift,
        control_matrix,
        game,
        np.array(HALF_WIDTHS),
        state_names=STATE_NAMES,
        state_units=STATE_UNITS,
        input_names=("thrust", "moment"),
        input_units=("N", "N m"),
        domain=(upright,),
        periods=(0.0, 0.0, 2.0 * np.pi, 0.0, 0.0, 0.0),
    )
