"""The vehicle under held commands: integrated with error control, with its cost beside it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import casadi
import numpy as np
from casadi import DM, SX

from ...symbolic import RunError, StationKeeping, Vehicle
from ...symbolic.arrays import Array
from ...symbolic.compiled import dense_function
from ...symbolic.underwater import acceleration, earth_frame, jacobian, jacobian_inverse
from ..loop import HeldRates, PlantState
from .disturbance import DisturbanceSource


class HeldPlant:
    """ζ_dot with body wrenches held over a control period (zero-order hold).

    The thrusters hold a body wrench τ_b; the earth-frame control that costs is
    u_1 = J^-T τ_b - u_trim. The disturbance that is attenuated is what any disturbance amounts to in
    the still-water model, d = M_bar η_ddot + C_bar η_dot + D_bar η_dot + g_bar - J^-T τ_b, evaluated as
    M_bar (η_ddot - η_ddot of the model under τ_b): J^-T τ_d for a force, the added drag and inertia for
    moving water, and where `vehicle` is another one than the model's, what the two differ by.
    """

    def __init__(
        self,
        station: StationKeeping,
        source: DisturbanceSource,
        tolerance: float = 1e-8,
        vehicle: Vehicle | None = None,
    ) -> None:
        self.station = station
        self.source = source
        self.tolerance = tolerance
        text = None if vehicle is None else vehicle.model_dump_json()
        size = np.append(1e-2 * station.half_widths, [1e-2, 1e-2])
        self._held = HeldRates(_rates(station, text), size, tolerance, compiled=station.compiled)
        self._current = np.array(station.model.current)

    def rates(self, t: float, zeta: Array, tau_b: Array, tau_d: Array) -> tuple[Array, Array, Array]:
        """Return (ζ_dot and both cost rates (14,), u_1 (6,), d (6,)) at time t."""
        here = self.source.at(t, zeta[:3])
        rates, u_control, disturbance = self._held.evaluate(
            zeta,
            tau_b,
            tau_d,
            here.force,
            here.water_velocity + self._current,
            here.water_acceleration,
        )
        return rates, u_control, disturbance

    def advance(self, t: float, state: PlantState, tau_b: Array, tau_d: Array, dt: float) -> PlantState:
        """Integrate over dt with the body wrenches τ_b and τ_d held, by DOP853.

        One compiled step over dt where the disturbance is steady and the error estimate allows it,
        otherwise scipy's.

        Raises
        ------
        RunError
            If the integration fails or becomes too stiff, or anything is not finite.
        """
        if not math.isfinite(tau_b @ tau_b + tau_d @ tau_d):
            raise RunError(f"the wrench is not finite at t = {t:.2f} s")
        y = np.concatenate((state.zeta, (state.cost, state.attenuated)))
        edges = [t, *(b for b in self.source.breaks if t < b < t + dt), t + dt]
        for start, end in pairwise(edges):
            stepped = self._one_step(start, end, y, tau_b, tau_d) if self.source.steady else None
            y = self._integrated(start, end, y, tau_b, tau_d) if stepped is None else stepped
        return PlantState(y[:12], float(y[12]), float(y[13]))

    def _one_step(self, start: float, end: float, y: Array, tau_b: Array, tau_d: Array) -> Array | None:
        """Return y at the end of one step, or None where its error is too large."""
        here = self.source.at(start, y[:3])
        water = here.water_velocity + self._current
        held = (tau_b, tau_d, here.force, water, here.water_acceleration)
        return self._held.one_step(y, end - start, *held)

    def _integrated(self, start: float, end: float, y: Array, tau_b: Array, tau_d: Array) -> Array:
        rates = self._under(tau_b, tau_d, np.nextafter(end, start))
        return self._held.integrated(start, end, y, rates)

    def _under(self, tau_b: Array, tau_d: Array, last: float) -> Callable[[float, Array], Array]:
        """Return the rates with wrenches held, up to the time `last` before the source breaks."""
        return lambda t, y: self.rates(min(t, last), y[:12], tau_b, tau_d)[0]


@lru_cache(maxsize=8)
def _rates(station: StationKeeping, vehicle: str | None) -> casadi.Function:
    """Return the rates under held wrenches; `vehicle` is the true one, as JSON."""
    return held_rates(station, None if vehicle is None else Vehicle.model_validate_json(vehicle))


def held_rates(station: StationKeeping, true: Vehicle | None = None) -> casadi.Function:
    """Return ζ_dot of the true vehicle, the cost rates, u_1 and d under held body wrenches."""
    model, game = station.model, station.game
    vehicle, zeta = model.vehicle, model.zeta
    tau_b, tau_d = SX.sym("tau_b", 6), SX.sym("tau_d", 6)
    force = SX.sym("force", 6)
    water, water_rate = SX.sym("water_velocity", 3), SX.sym("water_acceleration", 3)
    J = jacobian(zeta[:6])
    actual = acceleration(true or vehicle, zeta, tau_b + tau_d + J.T @ force, water, water_rate)
    modelled = acceleration(vehicle, zeta, tau_b, SX(DM(model.current)), SX(3, 1))
    M_bar = earth_frame(vehicle, zeta[:6], zeta[6:]).M_bar
    disturbance = M_bar @ (actual - modelled)
    u_control = jacobian_inverse(zeta[:6]).T @ tau_b - DM(model.u_trim)
    cost = zeta.T @ DM(game.Q) @ zeta + u_control.T @ DM(game.R) @ u_control
    attenuated = SX(0)
    if np.isfinite(game.gamma):
        attenuated = game.gamma**2 * disturbance.T @ DM(game.W_d) @ disturbance
    return dense_function(
        "held_plant",
        {
            "zeta": zeta,
            "tau_b": tau_b,
            "tau_d": tau_d,
            "force": force,
            "water_velocity": water,
            "water_acceleration": water_rate,
        },
        {
            "rates": casadi.vertcat(zeta[6:], actual, cost, attenuated),
            "u_control": u_control,
            "disturbance": disturbance,
        },
    )
