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
from numpy.typing import ArrayLike

from ...symbolic import InputError, Kernel, StationKeeping
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from ...symbolic.underwater import inverse_dynamics, jacobian_inverse
from .measurement import (
    Flags,
    Limits,
    MeasurementGate,
    require_dt,
    require_state,
    require_wrench,
)


class DisturbanceObserver:
    """Estimate what disturbs a vehicle, under any policy.

    Parameters
    ----------
    station : the vehicle's model
    bandwidth : ω_o [1/s]; well below the frequency of the waves, which it would follow too late

    limits : where measurements are flagged; those of vehicle and game if None

    Attributes
    ----------
    estimate : (6,) d_hat in the frame of ζ [N, N m]
    flags : why the last step learned nothing of its measurement, as a controller's; else empty

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

    def __init__(
        self, station: StationKeeping, bandwidth: float, *, limits: Limits | None = None
    ) -> None:
        if not (bandwidth > 0.0 and np.isfinite(bandwidth)):
            raise InputError(f"the observer's bandwidth is {bandwidth}, but must be positive, in 1/s")
        self.bandwidth = bandwidth
        self.estimate = np.zeros(6)
        self.flags: Flags = ()
        self._gate = MeasurementGate(station, limits or Limits.of(station))
        self._missing = _missing_force(station)
        self._zeta: Array | None = None
        self._tau_b: Array | None = None

    def step(self, zeta: ArrayLike, dt: float) -> Array:
        """Return d_hat at ζ (12,), dt [s] after the last step, the applied wrench held meanwhile.

        Flags as a controller does (`Controller`): a gap, a jump or a rate says nothing of the
        acceleration, and d_hat stays. So it does where it would not be finite.

        Raises
        ------
        InputError
            If ζ is not 12 finite numbers of a size that can be measured, dt is no positive time, or the
            pitch is beyond its limit; nothing changes.
        """
        state, dt = require_state(zeta), require_dt(dt)
        seen = self._gate.look(state, dt)
        last, tau_b = self._zeta, self._tau_b
        if last is not None and tau_b is not None and not set(seen.flags) - {"far"}:
            self.estimate = self._estimated(last, state, tau_b, dt)
        self._gate.keep(seen)
        self._zeta, self._tau_b, self.flags = state, None, seen.flags
        return self.estimate.copy()

    def _estimated(self, last: Array, zeta: Array, tau_b: Array, dt: float) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):  # of a tiny dt
            acceleration = (zeta[6:] - last[6:]) / dt
            ends = [self._missing(end, acceleration, tau_b)[0] for end in (last, zeta)]
            gap = 0.5 * (ends[0] + ends[1]) - self.estimate
            estimate = self.estimate - np.expm1(-self.bandwidth * dt) * gap
        return np.asarray(estimate) if np.isfinite(estimate).all() else self.estimate

    def applied(self, tau_b: ArrayLike) -> None:
        """Tell which wrench (6,) the vehicle gets until the next step [N, N m].

        Within the thrusters' limits: what they do not give would count as a disturbance, and be asked
        for once more. A step that was told none learns nothing.

        Raises
        ------
        InputError
            If it is not six finite numbers; the one that was told before stays.
        """
        self._tau_b = require_wrench(tau_b)


def _missing_force(station: StationKeeping) -> Kernel:
    """Return the force that η_ddot takes less J^-T τ_b, shape (6,), from ζ, η_ddot and τ_b."""
    model = station.model
    acceleration, tau_b = SX.sym("acceleration", 6), SX.sym("tau_b", 6)
    needed = inverse_dynamics(model.vehicle, model.zeta, acceleration, model.current)
    missing = needed - jacobian_inverse(model.zeta[:6]).T @ tau_b
    inputs = {"zeta": model.zeta, "acceleration": acceleration, "tau_b": tau_b}
    return Kernel(dense_function("missing_force", inputs, {"force": missing}))
