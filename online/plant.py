"""The vehicle under held commands: integrated with error control, with its cost beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import casadi
import numpy as np
from casadi import DM, SX

from ..symbolic import RunError, StationKeeping, Vehicle
from ..symbolic.dynamics import acceleration, earth_frame
from ..symbolic.integration import integrate
from ..symbolic.kernel import dense_function, export
from ..symbolic.kinematics import jacobian, jacobian_inverse
from ..symbolic.vehicle import Array
from .disturbance import DisturbanceSource


@dataclass(frozen=True)
class PlantState:
    """The vehicle at one instant.

    Attributes
    ----------
    zeta : (12,) pose error and rates
    cost : integral of ζ'Qζ + u_1'R u_1 so far
    attenuated : integral of γ^2 d'W_d d so far; the game's cost is the difference
    """

    zeta: Array
    cost: float
    attenuated: float


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
        self._kernel, _ = export(_held_rates(station, vehicle), compiled=station.model.compiled)
        self._current = np.array(station.model.current)

    def rates(self, t: float, zeta: Array, tau_b: Array, tau_d: Array) -> tuple[Array, Array, Array]:
        """Return (ζ_dot and both cost rates (14,), u_1 (6,), d (6,)) at time t."""
        here = self.source.at(t, zeta[:3])
        rates, u_control, disturbance = self._kernel(
            zeta,
            tau_b,
            tau_d,
            here.force,
            here.water_velocity + self._current,
            here.water_acceleration,
        )
        return rates, u_control, disturbance

    def advance(self, t: float, state: PlantState, tau_b: Array, tau_d: Array, dt: float) -> PlantState:
        """Integrate over dt with the body wrenches τ_b and τ_d held, by scipy's DOP853.

        Raises
        ------
        RunError
            If the integration fails or becomes too stiff, or anything is not finite.
        """
        if not (np.all(np.isfinite(tau_b)) and np.all(np.isfinite(tau_d))):
            raise RunError(f"the wrench is not finite at t = {t:.2f} s")
        y = np.append(state.zeta, [state.cost, state.attenuated])
        edges = [t, *(b for b in self.source.breaks if t < b < t + dt), t + dt]
        absolute = self.tolerance * np.append(1e-2 * self.station.half_widths, [1e-2, 1e-2])
        for start, end in pairwise(edges):
            y = integrate(
                self._held(tau_b, tau_d, np.nextafter(end, start)),
                y,
                np.array([start, end]),
                rtol=self.tolerance,
                atol=absolute,
                first_step=end - start,
                max_calls=20_000,
            )[-1]
        return PlantState(y[:12], float(y[12]), float(y[13]))

    def _held(self, tau_b: Array, tau_d: Array, last: float) -> Callable[[float, Array], Array]:
        """Return the rates with wrenches held, up to the time `last` before the source breaks."""
        return lambda t, y: self.rates(min(t, last), y[:12], tau_b, tau_d)[0]


def _held_rates(station: StationKeeping, true: Vehicle | None = None) -> casadi.Function:
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
