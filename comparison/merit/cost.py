"""What a run cost, up to any time and with what was still to come."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from ...online import History
from ...symbolic.arrays import Array


def cost_to_date(record: xr.Dataset) -> Array:
    """Return the cost up to each time, (time,): of the game, or of a `disturbed` run's control.

    The integral of r of (5), in `disturbed` mode of ζ'Qζ + u_1'R u_1.
    """
    spent = record["cost"].values
    if record.attrs["mode"] == "disturbed":
        return np.asarray(spent)
    return np.asarray(spent - record["attenuated"].values)


def cost_to_go(end: Array, P: Array) -> float:
    """Return ζ(T)'P ζ(T) of the end (n,) of a run, the estimate of what was still to come."""
    return float(end @ P @ end)


def game_cost(run: History | xr.Dataset, P: Array) -> float:
    """Return ∫ ζ'Qζ + u_1'R u_1 - γ^2 u_2'W_d u_2 dt + ζ(T)'P ζ(T), infinite if the run ended early.

    u_2 is what disturbed the run, in either mode.

    Parameters
    ----------
    run : or its record
    P : (n, n) of the game Riccati equation
    """
    if run.stopped if isinstance(run, History) else run.attrs["stopped"]:
        return math.inf
    cost, attenuated, end = (_last(run, name) for name in ("cost", "attenuated", "zeta"))
    return float(cost - attenuated + cost_to_go(end, P))


def _last(run: History | xr.Dataset, name: str) -> Array:
    column = getattr(run, name) if isinstance(run, History) else run[name].values
    return np.asarray(column[-1])


def dissipation_margin(record: xr.Dataset, V_start: float, V_end: float) -> float:
    """Return γ^2 ∫ d'W_d d + V(ζ_0) - ∫ (ζ'Qζ + u_1'R u_1) - V(ζ(T)); the L2 gain holds if >= 0.

    Guaranteed for the optimal u_1 alone: along it r + V_ζ (f + g (u_1 + d)) <= 0 for every d. d is what
    the disturbance amounts to in the still-water model (see `HeldPlant`), u_1 is without trim, and both
    integrals are the run's own, integrated with the state.
    """
    supplied, spent = (float(record[name].values[-1]) for name in ("attenuated", "cost"))
    return supplied + V_start - spent - V_end
