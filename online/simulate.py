"""A closed-loop run of any problem under any policy, as a record."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

from numpy.typing import ArrayLike

from ..symbolic import InputError, Problem
from ..symbolic.arrays import Array
from ..symbolic.toml import validate
from .loop import Disturbance, FunctionPolicy, Policy, ProblemSystem, Progress, RunSettings, drive
from .records import to_dataset

if TYPE_CHECKING:
    import xarray as xr


def simulate(
    problem: Problem,
    policy: Policy | Callable[[Array], Array],
    zeta0: ArrayLike,
    duration: float,
    *,
    control_period: float = 0.02,
    mode: Literal["game", "disturbed"] = "game",
    disturbance: Disturbance | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Return the record of ζ_dot = f + g_1 u_1 + g_2 u_2 from ζ_0 under a policy that is held.

    In `game` mode u_2 is the policy's disturbance player; a function of the state is answered as at the
    saddle point, u_2 = -γ^-2 W_d^-1 R u_1. In `disturbed` mode u_2 is a given disturbance.

    Parameters
    ----------
    policy : a function of the state that returns u_1 (k,), or an object with the steps of a `Policy`
    zeta0 : (n,) initial state; its angles are taken the short way, and are continuous from there on
    duration, control_period : [s]
    mode : who disturbs
    disturbance : d(t, ζ) (k_2,) of `disturbed` mode; nothing disturbs if None
    progress : called with the simulated time [s] after every control period

    Raises
    ------
    InputError
        If the state is not one of the problem, or the policy gives no input of it.

    Examples
    --------
    >>> record = simulate(two_state_game(), lambda zeta: np.array([-zeta[1]]), [1.0, -1.5], 10.0)
    >>> float(record["cost"][-1] - record["attenuated"][-1])  # in the game
    """
    start = problem.initial_state(zeta0)
    keys = {"duration": duration, "control_period": control_period, "mode": mode}
    settings = validate(RunSettings, keys | {"initial_state": tuple(start.tolist())}, "simulate")
    driven = FunctionPolicy(problem, policy) if callable(policy) else policy
    history = drive(ProblemSystem(problem, settings, disturbance), driven, None, progress)
    if history.stopped is not None and history.stopped.startswith("interrupted"):
        raise KeyboardInterrupt
    if not history.time:
        raise InputError(f"{problem.name}: {history.stopped}")
    return to_dataset(history, {"kind": "simulate", "mode": mode, "problem": problem.name})
