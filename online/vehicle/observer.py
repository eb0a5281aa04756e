"""A steady disturbance, estimated from what the vehicle did and fed forward like the trim.

Station keeping has no integral action: in a current the station is no equilibrium, and u_1(ζ) comes to
rest where u_1(ζ) = -d. Its force there is that of d whatever the policy; the error ζ is paid on top.
So what is known of d is added to the trim:

    d_hat_dot = ω_o (d - d_hat),   J^-T τ_b = u_1(ζ) + u_trim - d_hat.

d is what the disturbance amounts to in the still-water model, as in `HeldPlant`: the force that the
motion takes (`inverse_dynamics`) less the force that was applied, J^-T τ_b. The acceleration is not
measured, but over a control period Δ its mean is (η_dot_+ - η_dot) / Δ, and the force is linear in it.
With the mean of d at both ends

    d_hat += (1 - exp(-ω_o Δ)) (d_mean - d_hat),

the momentum observer of De Luca and Mattone (2003). With an exact model d_hat depends on d alone,
neither on the policy nor on what it learns, and the loop is a cascade: where d is steady it ends in the
game's own closed loop, the one that is learned and predicted, at ζ = 0.
"""

from __future__ import annotations

import numpy as np
from casadi import SX

from ...symbolic import InputError, Kernel, StationKeeping
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from ...symbolic.underwater import inverse_dynamics, jacobian_inverse


class DisturbanceObserver:
    """Estimate what disturbs a vehicle, under any policy.

    Parameters
    ----------
    station : the vehicle's model
    bandwidth : ω_o [1/s]; well below the frequency of the waves, which it would follow too late

    Attributes
    ----------
    estimate : (6,) d_hat in the frame of ζ [N, N m]

    Raises
    ------
    InputError
        If the bandwidth is not positive.

    Examples
    --------
    >>> observer = DisturbanceObserver(controller.setup, bandwidth=0.5)
    >>> tau_b = controller.step(eta, eta_dot, dt)
    >>> tau_b = tau_b - controller.body_wrench(observer.step(controller.zeta, dt))
    >>> observer.applied(tau_b)
    """

    def __init__(self, station: StationKeeping, bandwidth: float) -> None:
        if not (bandwidth > 0.0 and np.isfinite(bandwidth)):
            raise InputError(f"the observer's bandwidth is {bandwidth}, but must be positive, in 1/s")
        self.bandwidth = bandwidth
        self.estimate = np.zeros(6)
        self._missing = _missing_force(station)
        self._zeta: Array | None = None
        self._tau_b: Array | None = None

    def step(self, zeta: Array, dt: float) -> Array:
        """Return d_hat at ζ (12,), dt [s] after the last step, the applied wrench held meanwhile."""
        if self._zeta is not None and self._tau_b is not None:
            acceleration = (zeta[6:] - self._zeta[6:]) / dt
            ends = [self._missing(end, acceleration, self._tau_b)[0] for end in (self._zeta, zeta)]
            gap = 0.5 * (ends[0] + ends[1]) - self.estimate
            self.estimate = self.estimate - np.expm1(-self.bandwidth * dt) * gap
        self._zeta, self._tau_b = zeta, None
        return self.estimate

    def applied(self, tau_b: Array) -> None:
        """Tell which wrench (6,) the vehicle gets until the next step [N, N m].

        Within the thrusters' limits: what they do not give would count as a disturbance, and be asked
        for once more. A step that was told none learns nothing.
        """
        self._tau_b = tau_b


def _missing_force(station: StationKeeping) -> Kernel:
    """Return the force that η_ddot takes less J^-T τ_b, shape (6,), from ζ, η_ddot and τ_b."""
    model = station.model
    acceleration, tau_b = SX.sym("acceleration", 6), SX.sym("tau_b", 6)
    needed = inverse_dynamics(model.vehicle, model.zeta, acceleration, model.current)
    missing = needed - jacobian_inverse(model.zeta[:6]).T @ tau_b
    inputs = {"zeta": model.zeta, "acceleration": acceleration, "tau_b": tau_b}
    return Kernel(dense_function("missing_force", inputs, {"force": missing}))
