"""Figures of merit of a run against the optimum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ..symbolic import StationKeeping, Vehicle
from ..symbolic.vehicle import Array


@dataclass(frozen=True)
class RunMetrics:
    """What one run cost.

    Attributes
    ----------
    cost : integral of r of (5) in `game` mode, of ζ'Qζ + u_1'R u_1 in `disturbed` mode, plus
        ζ(T)'P ζ(T) for the rest; None if the run ended early
    regret : (cost - V*) / V*; None without an optimum or if the run ended early
    position_rms : [m]; None if the run ended before it began
    effort : integral of |τ_b force|^2 [N^2 s]
    rest_share : part of the cost that is the estimate ζ(T)'P ζ(T)
    peak_thrust : largest share of a thruster's limit that the least-norm allocation asks for [-]
    stopped : why the run ended early, or None
    """

    cost: float | None
    regret: float | None
    position_rms: float | None
    effort: float
    rest_share: float | None
    peak_thrust: float | None
    stopped: str | None


def run_metrics(record: xr.Dataset, station: StationKeeping, optimum: float | None) -> RunMetrics:
    """Return the figures of merit of a closed-loop record against V* = `optimum`.

    In `game` mode u_2 is what the run's own disturbance player did.
    """
    stopped = str(record.attrs["stopped"]) or None
    zeta, time = record["zeta"].values, record["time"].values
    cost = rest_share = None
    if stopped is None:
        rest = float(zeta[-1] @ station.problem.P @ zeta[-1])
        cost = float(cost_to_date(record)[-1]) + rest
        rest_share = rest / cost if cost > 0.0 else 0.0
    tau_b = record["tau_b"].values
    return RunMetrics(
        cost=cost,
        regret=None if cost is None or optimum is None else (cost - optimum) / optimum,
        position_rms=float(np.sqrt(np.mean(np.sum(zeta[:, :3] ** 2, axis=1)))) if len(time) else None,
        effort=float(np.trapezoid(np.sum(tau_b[:, :3] ** 2, axis=1), time)),
        rest_share=rest_share,
        peak_thrust=peak_thrust(tau_b, station.model.vehicle),
        stopped=stopped,
    )


def cost_to_date(record: xr.Dataset) -> Array:
    """Return the cost up to each time, (time,): of the game, or of a `disturbed` run's control."""
    spent = record["cost"].values
    if record.attrs["mode"] == "disturbed":
        return np.asarray(spent)
    return np.asarray(spent - record["attenuated"].values)


def peak_thrust(tau_b: Array, vehicle: Vehicle) -> float | None:
    """Return the largest thrust over its limit, least-norm allocation; None without thrusters."""
    if vehicle.thrusters is None or not len(tau_b):
        return None
    thrust = vehicle.thrusters.thrust(tau_b)
    reverse, forward = vehicle.thrusters.limits
    return float(np.maximum(thrust / forward, thrust / reverse).max())


def distribution(regrets: list[float | None]) -> dict[str, Any]:
    """Return median, 90 % quantile and maximum of the finished runs, the number that ended early
    (`diverged`) and the number of all (`n`).
    """
    finished = [regret for regret in regrets if regret is not None]
    diverged = len(regrets) - len(finished)
    if not finished:
        return {"median": None, "p90": None, "max": None, "diverged": diverged, "n": len(regrets)}
    return {
        "median": float(np.median(finished)),
        "p90": float(np.quantile(finished, 0.9)),
        "max": float(np.max(finished)),
        "diverged": diverged,
        "n": len(regrets),
    }


def dissipation_margin(record: xr.Dataset, station: StationKeeping, V_start: float) -> float:
    """Return γ^2 ∫ d'W_d d + V(ζ_0) - ∫ (ζ'Qζ + u_1'R u_1) - ζ(T)'P ζ(T); the L2 gain holds if >= 0."""
    final = record["zeta"].values[-1]
    stored = float(final @ station.problem.P @ final)
    spent = float(record["cost"].values[-1])
    return float(record["attenuated"].values[-1]) + V_start - spent - stored
