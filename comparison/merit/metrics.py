"""Figures of merit of a run against the optimum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ...offline import DirectSolution, DirectSolver
from ...symbolic import Setup, StationKeeping, Vehicle
from ...symbolic.arrays import Array


@dataclass(frozen=True)
class RunMetrics:
    """What one run cost.

    Attributes
    ----------
    cost : integral of r of (5) in `game` mode, of ζ'Qζ + u_1'R u_1 in `disturbed` mode, plus
        ζ(T)'P ζ(T) for the rest; None if the run ended early
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
        learns or predicts only now and then has a much higher mean
    rest_share : part of the cost that is the estimate ζ(T)'P ζ(T)
    peak_thrust : largest share of a thruster's limit that the least-norm allocation asks for [-]
    stopped : why the run ended early, or None
    """

    cost: float | None
    running_cost: float | None
    regret: float | None
    position_rms: float | None
    excursion: float | None
    effort: float
    energy: float | None
    saturated: float | None
    policy_microseconds: float
    policy_mean: float
    rest_share: float | None
    peak_thrust: float | None
    stopped: str | None


def run_metrics(record: xr.Dataset, station: StationKeeping, optimum: float | None) -> RunMetrics:
    """Return the figures of merit of a closed-loop record against V* = `optimum`.

    In `game` mode u_2 is what the run's own disturbance player did.
    """
    stopped = str(record.attrs["stopped"]) or None
    zeta, time = record["zeta"].values, record["time"].values
    cost = running_cost = rest_share = None
    if stopped is None:
        rest = float(zeta[-1] @ station.problem.P @ zeta[-1])
        running_cost = float(cost_to_date(record)[-1])
        cost = running_cost + rest
        rest_share = rest / cost if cost > 0.0 else 0.0
    tau_b = record["tau_b"].values
    distance = np.linalg.norm(zeta[:, :3], axis=1)
    saturated = record.attrs.get("saturated")
    return RunMetrics(
        cost=cost,
        running_cost=running_cost,
        regret=None if cost is None or optimum is None else (cost - optimum) / optimum,
        position_rms=float(np.sqrt(np.mean(distance**2))) if len(time) else None,
        excursion=float(distance.max()) if len(time) else None,
        effort=float(np.trapezoid(np.sum(tau_b[:, :3] ** 2, axis=1), time)),
        energy=energy(record, station.model.vehicle),
        saturated=None if saturated is None else float(saturated),
        policy_microseconds=float(record.attrs["policy_microseconds"]),
        policy_mean=float(record.attrs["policy_microseconds_mean"]),
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


def dissipation_margin(record: xr.Dataset, V_start: float, V_end: float) -> float:
    """Return γ^2 ∫ d'W_d d + V(ζ_0) - ∫ (ζ'Qζ + u_1'R u_1) - V(ζ(T)); the L2 gain holds if >= 0.

    Guaranteed for the optimal u_1 alone: along it r + V_ζ (f + g (u_1 + d)) <= 0 for every d. d is what
    the disturbance amounts to in the still-water model (see `HeldPlant`), u_1 is without trim, and both
    integrals are the run's own, integrated with the state.
    """
    supplied, spent = (float(record[name].values[-1]) for name in ("attenuated", "cost"))
    return supplied + V_start - spent - V_end


class GameValue:
    """V* of a game at any state by one structured Newton solve, to about 1e-6 of itself."""

    def __init__(self, setup: Setup) -> None:
        self._solver = DirectSolver(setup.problem, horizon=60.0, n_intervals=16, degree=6, grading=6.0)

    def __call__(self, zeta: Array) -> float:
        """Return V*(ζ); raises RunError where the solver does not converge."""
        return self.with_costate(zeta)[0]

    def with_costate(self, zeta: Array) -> tuple[float, Array]:
        """Return V*(ζ) and its gradient, (n,); raises RunError where the solver does not converge."""
        found = self.solution(zeta)
        return found.value, found.costate

    def solution(self, zeta: Array) -> DirectSolution:
        """Return the solve behind V*(ζ); raises RunError where the solver does not converge."""
        return self._solver.solve(zeta, verify=False)
