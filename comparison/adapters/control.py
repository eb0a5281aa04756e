"""The vehicle, alone or under a policy, as a nonlinear system of the python-control package.

    open:    ζ_dot = f(ζ, τ_b),                     output ζ
    closed:  ζ_dot = f(ζ, J'(u_1(ζ) + u_trim) + τ_d), outputs ζ and τ_b

in continuous time: the control is not held. Needs `pip install 'stationkeep[control]'`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ...online import Controller, VehiclePolicy
from ...symbolic import InputError, Kernel, Model
from ...symbolic.arrays import Array
from ...symbolic.underwater import ANGLES, FORCE_NAMES, STATE_NAMES
from ..policies import LinearPolicy, OnVehicle
from ..scenario import Scenario

if TYPE_CHECKING:
    import control

Law = Callable[[Array], Array]
WRENCH = [f"tau_{name}" for name in FORCE_NAMES]
DISTURBANCE = [f"tau_d_{name}" for name in FORCE_NAMES]


def to_control(scenario: Scenario, policy: VehiclePolicy | None = None) -> control.NonlinearIOSystem:
    """Return the driven vehicle of a scenario as a continuous-time system, in its known current.

    Parameters
    ----------
    policy : None for the vehicle alone; a `LinearPolicy` (or `LQR`), or a `Controller` that does not
        learn, whose actor weights are then held as they are now

    Returns
    -------
    control.NonlinearIOSystem
        States x, y, z [m], phi, theta, psi [rad] and their rates x_dot ... [m/s, rad/s], 12 in all,
        which are outputs too. Alone: inputs tau_X ... tau_N, the body wrench τ_b [N, N m]. In closed
        loop: inputs tau_d_X ... tau_d_N, a body wrench τ_d that disturbs, and tau_X ... tau_N among
        the outputs.

    Raises
    ------
    InputError
        If python-control is not installed, or the policy is not a function of the state alone.
    """
    try:
        import control
    except ImportError:
        raise InputError(
            "python-control is not installed; install it with pip install 'stationkeep[control]'"
        ) from None
    station = scenario.station_keeping()
    vehicle = scenario.plant_vehicle()
    driven = station.model if vehicle is None else Model(vehicle, scenario.current)
    rates = _rates(driven.plant, np.array(scenario.current))
    wrench = None if policy is None else _wrench(station.model, _law(policy))
    update, output = (rates, _state) if wrench is None else _closed(rates, wrench)
    name = driven.vehicle.name.replace(".", "_")  # python-control has a use of its own for the dot
    inputs, extra = (WRENCH, []) if wrench is None else (DISTURBANCE, WRENCH)
    return control.nlsys(
        lambda t, zeta, u, params: update(zeta, u),
        lambda t, zeta, u, params: output(zeta, u),
        inputs=inputs,
        states=list(STATE_NAMES),
        outputs=[*STATE_NAMES, *extra],
        name=name if policy is None else f"{name} in closed loop",
    )


def _rates(plant: Kernel, current: Array) -> Callable[[Array, Array], Array]:
    """Return ζ_dot of ζ and a body wrench in a steady current."""
    still = np.zeros(6)
    return lambda zeta, tau: plant(zeta, tau, still, current, np.zeros(3))[0]


def _state(zeta: Array, tau: Array) -> Array:
    """Return ζ, the output of the vehicle alone."""
    return zeta


def _closed(
    rates: Callable[[Array, Array], Array], wrench: Law
) -> tuple[Callable[[Array, Array], Array], Callable[[Array, Array], Array]]:
    """Return ζ_dot and (ζ, τ_b) of ζ and a disturbing body wrench."""
    return (
        lambda zeta, tau_d: rates(zeta, wrench(zeta) + tau_d),
        lambda zeta, tau_d: np.concatenate([zeta, wrench(zeta)]),
    )


def _wrench(model: Model, law: Law) -> Law:
    """Return τ_b = J'(u_1(ζ) + u_trim), the attitude written the short way as policies take it."""

    def wrench(zeta: Array) -> Array:
        wrapped = ANGLES.wrapped(np.asarray(zeta, dtype=float))
        (J,) = model.kinematics(wrapped[:6])
        return np.asarray(J.T @ (law(wrapped) + model.u_trim))

    return wrench


def _law(policy: VehiclePolicy) -> Law:
    """Return u_1 as a function of ζ alone."""
    if isinstance(policy, OnVehicle) and isinstance(policy.policy, LinearPolicy):
        law = policy.policy
        return lambda zeta: law.control(zeta, 0.0)
    if isinstance(policy, Controller) and not policy.learned.learn:
        return lambda zeta: policy.learner.policies(zeta)[0]
    kind = type(policy.policy if isinstance(policy, OnVehicle) else policy).__name__
    raise InputError(
        f"a {kind} that learns or remembers is no function of the state; give a "
        "LinearPolicy, or a Controller made with learn=False"
    )
