"""Figures of merit of a run against the optimum: of any problem, and those that only a vehicle has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ...offline import QuickValue
from ...symbolic import RunError, Setup, StationKeeping, Vehicle
from ...symbolic.arrays import Array
from .cost import cost_to_date, cost_to_go
from .learning import learning_fault
from .regrets import regret

SMALL_REST = 1e-3  # of the cost: what is left may be estimated as ζ'P ζ
ESTIMATE_ERROR = 1e-2  # relative, of that estimate then
RUN_ERROR = 1e-7  # relative, of a run's integrals, which are integrated with error control to 1e-8


@dataclass(frozen=True)
class RunMetrics:
    """What one run cost.

    `position_rms`, `excursion`, `effort`, `energy`, `saturated` and `peak_thrust` are what only the run
    of a vehicle has, None for any other problem.

    Attributes
    ----------
    cost : integral of r of (5) in `game` mode, of ζ'Qζ + u_1'R u_1 in `disturbed` mode, plus what is
        left after the run; None if the run ended early
    running_cost : the integral alone; None if the run ended early
    regret : (cost - V*) / V*, or in `disturbed` mode (running cost - V_c) / V_c with the clairvoyant
        optimum; None without an optimum or if the run ended early
    position_rms : [m]; None if the run ended before it began
    excursion : largest distance from the station [m]; likewise
    effort : integral of |τ_b force|^2 [N^2 s]
    energy : electrical energy of the thrusters [J]; None if their power is not known
    saturated : share of the control steps at which a thruster was asked for more than its limit; None
        in a run without limits
    policy_microseconds, policy_mean : median and mean wall time of a policy's step [us]; a policy that
        learns or predicts only now and then has a much higher mean; None if it was not taken
    rest_share : part of the cost that is what is left: ζ(T)'P ζ(T), or V*(ζ(T)) where it is more than a
        thousandth of a game's cost and V* is known
    peak_thrust : largest share of a thruster's limit that the least-norm allocation asks for [-]
    stopped : why the run ended early, or None
    unlearned : why its learner learned nothing although it was due, or None
    cost_error : relative, of the cost: of its integral and of what is left; None if the run ended early
    """

    cost: float | None
    running_cost: float | None
    regret: float | None
    position_rms: float | None
    excursion: float | None
    effort: float | None
    energy: float | None
    saturated: float | None
    policy_microseconds: float | None
    policy_mean: float | None
    rest_share: float | None
    peak_thrust: float | None
    stopped: str | None
    unlearned: str | None = None
    cost_error: float | None = None


def run_metrics(
    record: xr.Dataset,
    setup: Setup,
    optimum: float | None,
    value: Callable[[Array], float] | None = None,
) -> RunMetrics:
    """Return the figures of merit of a closed-loop record against V* = `optimum`.

    In `game` mode u_2 is what the run's own disturbance player did.

    Parameters
    ----------
    record : with `zeta`, `cost` and `attenuated` over `time`; of a vehicle with `tau_b`, too
    setup : of the problem; a `StationKeeping` for what only a vehicle has
    optimum : None if it is not known
    value : V* for what is left after a run of the game; ζ'P ζ if None
    """
    stopped = str(record.attrs["stopped"]) or None
    cost = running_cost = rest_share = cost_error = None
    if stopped is None:
        running_cost = float(cost_to_date(record)[-1])
        known = value if record.attrs["mode"] == "game" else None
        rest, error = _rest(record["zeta"].values[-1], setup.problem.P, running_cost, known)
        cost = running_cost + rest
        rest_share = rest / cost if cost > 0.0 else 0.0
        cost_error = RUN_ERROR + (error / cost if cost > 0.0 else 0.0)
    vehicle = setup.model.vehicle if isinstance(setup, StationKeeping) and "tau_b" in record else None
    position = record["zeta"].values[: 0 if vehicle is None else None, :3]
    distance = np.linalg.norm(position, axis=1)
    return RunMetrics(
        cost=cost,
        running_cost=running_cost,
        regret=regret(cost, optimum),
        position_rms=float(np.sqrt(np.mean(distance**2))) if len(distance) else None,
        excursion=float(distance.max()) if len(distance) else None,
        effort=None if vehicle is None else effort(record),
        energy=None if vehicle is None else energy(record, vehicle),
        saturated=None if vehicle is None else _attribute(record, "saturated"),
        policy_microseconds=_attribute(record, "policy_microseconds"),
        policy_mean=_attribute(record, "policy_microseconds_mean"),
        rest_share=rest_share,
        peak_thrust=None if vehicle is None else peak_thrust(record["tau_b"].values, vehicle),
        stopped=stopped,
        unlearned=learning_fault(record),
        cost_error=cost_error,
    )


def _rest(
    end: Array, P: Array, spent: float, value: Callable[[Array], float] | None
) -> tuple[float, float]:
    """Return what is left of the cost after a run, and its error.

    ζ'P ζ knows the linearised plant only: far from the station it may be too small, as where drag is
    quadratic alone, and a run that ends there would cost less than the optimum.
    """
    estimate = cost_to_go(end, P)
    if estimate <= SMALL_REST * (spent + estimate):
        return estimate, ESTIMATE_ERROR * estimate
    if value is not None:
        try:
            rest = value(end)
        except RunError:
            return estimate, estimate
        return rest, QuickValue.error * rest
    return estimate, estimate


def _attribute(record: xr.Dataset, name: str) -> float | None:
    value = record.attrs.get(name)
    return None if value is None else float(value)


def effort(record: xr.Dataset) -> float:
    """Return the integral of |τ_b force|^2 over a run [N^2 s]."""
    force = record["tau_b"].values[:, :3]
    return float(np.trapezoid(np.sum(force**2, axis=1), record["time"].values))


def peak_thrust(tau_b: Array, vehicle: Vehicle) -> float | None:
    """Return the largest thrust over its limit, least-norm allocation; None without thrusters."""
    if vehicle.thrusters is None or not len(tau_b):
        return None
    thrust = vehicle.thrusters.thrust(tau_b)
    reverse, forward = vehicle.thrusters.limits
    return float(np.maximum(thrust / forward, thrust / reverse).max())


def energy(record: xr.Dataset, vehicle: Vehicle) -> float | None:
    """Return the electrical energy of a run [J], each thrust held for its control period.

    Of the recorded thrusts, or without limits of the least-norm ones. None where the power of the
    thrusters is not known.
    """
    if vehicle.thrusters is None:
        return None
    limited = "thrust" in record
    thrust = record["thrust"].values if limited else vehicle.thrusters.thrust(record["tau_b"].values)
    power = vehicle.thrusters.power(thrust)
    return None if power is None else float(power[:-1] @ np.diff(record["time"].values))
