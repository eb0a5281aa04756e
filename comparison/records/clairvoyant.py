"""The clairvoyant optimum of a `disturbed` run: what a control could reach that knows all of d(t).

    V_c = min over u_1(t) of  ∫_0^T ζ'Qζ + u_1'R u_1 dt,   ζ_dot of the driven vehicle under u_1 and d

from the run's initial state, over the time that the run takes, with no cost after T. A policy's held
wrenches τ_b are one choice of u_1(t) = J^-T τ_b - u_trim, so its run can't cost less, and

    regret = (∫_0^T ζ'Qζ + u_1'R u_1 dt of the run - V_c) / V_c

is what it pays for not knowing the future, the limits of its thrusters and its own faults.

The solver's plant is the expression of the runs' plant; the check is that plant itself, compiled, with
the disturbance as numbers, integrated by scipy with the control that was found.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from casadi import DM, SX

from ...offline import Trajectory
from ...offline.direct import Stage, against_known, by_turns
from ...offline.responses import Clairvoyant, ClairvoyantSolver, Policy
from ...online import build_disturbance
from ...online.records import versions
from ...online.vehicle import HeldPlant, KnownSource, held_rates
from ...symbolic import RunError, StationKeeping, Vehicle
from ...symbolic.arrays import Array
from ...symbolic.integration import integrate
from ...symbolic.underwater import jacobian
from ..policies import LQR
from ..scenario import Scenario
from .provenance import provenance
from .runs import failure_record, path_dataset
from .store import reused

KIND = "clairvoyant"
LARGEST_ERROR = 1e-3  # relative, of a value that counts as found
_SIMULATION = (
    "initial_state",
    "duration",
    "control_period",
    "disturbance",
    "plant",
    "plant_parameters",
)
KEY: dict[str, Any] = {
    **dict.fromkeys(("vehicle", "current", "envelope"), True),
    "game": {"Q": True, "R": True},
    "simulation": dict.fromkeys(_SIMULATION, True),
    "offline": {"max_iterations": True, "max_seconds": True},
}


@dataclass(frozen=True)
class SelfCheck:
    """What the runs' plant makes of a control that the solver found.

    Attributes
    ----------
    cost : integral of ζ'Qζ + u_1'R u_1 along the integrated states
    final_defect, largest_defect : gap of integrated and collocated states, at T and at any mesh point
        [half-widths]
    """

    cost: float
    final_defect: float
    largest_defect: float


def optimum_name(record: xr.Dataset) -> str:
    """Return what a figure calls the record of an optimum: optimal that of the game, or clairvoyant."""
    return KIND if record.attrs.get("kind") == KIND else "optimal"


def clairvoyant_record(scenario: Scenario, path: Path | None = None) -> xr.Dataset:
    """Return the record of the clairvoyant optimum, from `path` if it holds this very solve.

    Raises
    ------
    RunError
        If the solver does not converge; that is kept too.
    """
    attributes = clairvoyant_provenance(scenario)
    record = reused(path, attributes["key"], lambda: clairvoyant_or_failure(scenario, attributes))
    if "failed" in record.attrs:
        raise RunError(str(record.attrs["failed"]))
    return record


def clairvoyant_provenance(scenario: Scenario) -> dict[str, Any]:
    """Return `provenance` of the clairvoyant optimum of a scenario's run."""
    return provenance(scenario, KIND, KEY)


def clairvoyant_or_failure(scenario: Scenario, attributes: dict[str, Any]) -> xr.Dataset:
    """Return the record of the clairvoyant optimum, or of the solver's failure: `failed`, no path."""
    try:
        found, check = clairvoyant(scenario)
    except RunError as error:
        return failure_record(scenario.initial_state, {**attributes, "failed": str(error)})
    station, path = scenario.station_keeping(), found.path
    local = np.sum(path.states[1:] @ station.game.Q * path.states[1:], axis=1)
    local += np.sum(path.v @ station.game.R * path.v, axis=1)
    described = {**versions(), **_described(found, check), "degree": path.degree}
    return path_dataset(station, path, path.v, local, attributes | described)


def _described(found: Clairvoyant, check: SelfCheck) -> dict[str, Any]:
    size = max(found.value, np.finfo(float).tiny)
    gap = abs(check.cost - found.value) / size
    confirmed = np.isfinite(found.mesh_error)
    error = gap + (found.mesh_error if confirmed else 0.0)
    faults = [] if confirmed else ["one degree more did not converge, and only integration checks it"]
    if found.ended:
        faults.insert(0, found.ended)
    if not error <= LARGEST_ERROR:
        faults.append(f"the value's relative error is {error:.1e}, over {LARGEST_ERROR:.0e}")
    if not found.second_order.holds:
        faults.append("it is no strict local minimum")
    return {
        "value": found.value,
        "value_error": error,
        "mesh_error": found.mesh_error,
        "reintegration_error": gap,
        "final_defect": check.final_defect,
        "largest_defect": check.largest_defect,
        "second_order": found.second_order.margin,
        "start_spread": float((np.nanmax(found.starts) - np.nanmin(found.starts)) / size),
        "starts": json.dumps([None if np.isnan(cost) else cost for cost in found.starts.tolist()]),
        "rounds": found.rounds,
        "intervals": len(found.path.mesh) - 1,
        "iterations": found.iterations,
        "seconds": found.seconds,
        "faults": "; ".join(faults),
    }


def clairvoyant(scenario: Scenario) -> tuple[Clairvoyant, SelfCheck]:
    """Return the clairvoyant optimum of a scenario's run, and what its plant makes of it.

    Raises
    ------
    RunError
        If the solver does not converge, or its control loses the plant.
    """
    station, settings = scenario.station_keeping(), scenario.simulation
    vehicle, source = scenario.plant_vehicle(), build_disturbance(settings.disturbance)
    stage = known_stage(station, source, vehicle)
    horizon = max(round(settings.duration / settings.control_period), 1) * settings.control_period
    compiled = (
        station.model.compiled and source.steady
    )  # what is not has too many numbers for one solve
    solver = ClairvoyantSolver(
        stage,
        station.game.R,
        horizon,
        source.breaks,
        limits=scenario.offline.limits,
        compiled=compiled,
    )
    plant = HeldPlant(station, source, vehicle=vehicle)
    starts = station.problem.starts(scenario.initial_state)
    turns = by_turns(starts, lambda start: (solver.solve(start, _policies(plant)), start))
    found, zeta0 = min(turns, key=lambda turn: turn[0].value)
    return found, self_check(plant, zeta0, found.path)


def _policies(plant: HeldPlant) -> Iterator[Policy]:
    """Yield controls to start from: LQR alone, and with what cancels d, towards several attitudes.

    The attitudes are level and half a half-width to either side in pitch and yaw: how the vehicle
    presents itself to the water is what local minima differ by.
    """
    station, still = plant.station, np.zeros(6)
    gain, model = LQR(station.problem).gain, station.model

    def towards(target: Array) -> Policy:
        def policy(t: float, zeta: Array) -> Array:
            tau_b = model.kinematics(zeta[:6])[0].T @ model.u_trim
            return -gain @ (zeta - target) - plant.rates(t, zeta, tau_b, still)[2]

        return policy

    yield lambda t, zeta: -gain @ zeta
    for pitch, yaw in ((0.0, 0.0), (0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)):
        target = np.zeros(12)
        target[4:6] = np.array([pitch, yaw]) * station.half_widths[4:6]
        yield towards(target)


def known_stage(station: StationKeeping, source: KnownSource, vehicle: Vehicle | None = None) -> Stage:
    """Return the control's problem on the plant of the runs, as `HeldPlant` has it.

    Parameters
    ----------
    vehicle : the one that is driven, None for the model's
    """
    model, game = station.model, station.game
    zeta, u_control, t = SX.sym("zeta", 12), SX.sym("u_control", 6), SX.sym("t")
    tau_b = jacobian(zeta[:6]).T @ (u_control + DM(model.u_trim))
    force, water, water_rate = source.expression(t, zeta[:3])
    water = water + DM(model.current)
    rates = held_rates(station, vehicle)(zeta, tau_b, SX(6, 1), force, water, water_rate)[0]
    return against_known(zeta, u_control, t, rates[:12], game.Q, game.R)


def self_check(plant: HeldPlant, zeta0: Array, path: Trajectory) -> SelfCheck:
    """Integrate the plant of the runs from ζ_0 under u_1 = u_c(t) - K (ζ - ζ_c(t)), by DOP853.

    u_c and ζ_c are the polynomials of the path, K is LQR's: without feedback errors would grow by the
    moment with which water turns a hull. Where the path is the plant's own nothing is fed back.

    Raises
    ------
    RunError
        If the integration fails.
    """
    collocated, half_widths, gain = (
        path.at_mesh(),
        plant.station.half_widths,
        LQR(plant.station.problem).gain,
    )
    y, defects = np.append(zeta0, 0.0), []
    atol = 1e-12 * np.append(half_widths, 1.0)
    for i, span in enumerate(pairwise(path.mesh)):
        y = integrate(_rates(plant, path, gain, i), y, np.array(span), rtol=1e-10, atol=atol)[-1]
        defects.append(float(np.abs((y[:12] - collocated[i + 1]) / half_widths).max()))
    return SelfCheck(cost=float(y[12]), final_defect=defects[-1], largest_defect=max(defects))


def _rates(
    plant: HeldPlant, path: Trajectory, gain: Array, interval: int
) -> Callable[[float, Array], Array]:
    """Return ζ_dot and the cost rate (13,) within one interval of the path."""
    control, states = path.input_polynomial(interval), path.state_polynomial(interval)
    model, still = plant.station.model, np.zeros(6)
    last = np.nextafter(path.mesh[interval + 1], 0.0)

    def rates(t: float, y: Array) -> Array:
        u_control = control(t) - gain @ (y[:12] - states(t))
        tau_b = model.kinematics(y[:6])[0].T @ (u_control + model.u_trim)
        return plant.rates(min(t, last), y[:12], tau_b, still)[0][:13]

    return rates
