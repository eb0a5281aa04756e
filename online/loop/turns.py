"""A run counts an attitude from the station that it goes to, whichever turn leads there.

Inside a run the state is continuous. Where an angle gets farther than half a turn and an eighth, the
policies, which take an attitude as one thing, go on instead of back. The run is then written by that
turn from its start: the same motion, its states less c and its cost as from the start ζ(0) - c,

    ∫ (ζ - c)'Q (ζ - c) dt = ∫ ζ'Qζ dt - 2 c'Q ∫ ζ dt + c'Qc t.

So the cost is never below the value from there, and V*, the least over the turns, bounds it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...symbolic.arrays import Array
from .history import History
from .plant import PlantState


def by_its_turn(history: History, state: PlantState, t: float) -> PlantState:
    """Return the state at t [s] by the turn that it takes, and write its history by it."""
    zeta = history.problem.angles.reentered(state.zeta)
    if zeta is state.zeta:
        return state
    if not history.time:
        return replace(state, zeta=zeta)
    c, Q = state.zeta - zeta, history.problem.game.Q
    times = np.append(history.time, t)
    pull = np.array([*history.zeta, state.zeta]) @ Q @ c
    more = (c @ Q @ c) * times - 2.0 * integrated(times, pull)
    history.zeta[:] = [each - c for each in history.zeta]
    history.cost[:] = [cost + float(extra) for cost, extra in zip(history.cost, more[:-1], strict=True)]
    return replace(state, zeta=zeta, cost=state.cost + float(more[-1]))


def integrated(times: Array, values: Array) -> Array:
    """Return the integral of `values` (N,) up to each time (N,), by the corrected trapezoidal rule.

    h/2 (f_0 + f_1) - h^2/12 (f_1' - f_0') with slopes from differences; its error falls like h^4.
    """
    h = np.diff(times)
    slopes = np.gradient(values, times, edge_order=2 if len(times) > 2 else 1)
    parts = 0.5 * h * (values[1:] + values[:-1]) - h**2 / 12.0 * np.diff(slopes)
    return np.append(0.0, np.cumsum(parts))
