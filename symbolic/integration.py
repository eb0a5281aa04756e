"""Integration with error control that always ends: scipy's methods with a limit on the calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeVar

import numpy as np
from casadi import MX, SX
from scipy.integrate import solve_ivp

from .errors import RunError
from .vehicle import Array

E = TypeVar("E", SX, MX)


def runge_kutta_step(rate: Callable[[E], E], y: E, h: E | float) -> E:
    """Return y after one step of the classical fourth-order Runge-Kutta method, as an expression."""
    k_1 = rate(y)
    k_2 = rate(y + h / 2 * k_1)
    k_3 = rate(y + h / 2 * k_2)
    k_4 = rate(y + h * k_3)
    return y + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)


def integrate(
    rhs: Callable[[float, Array], Array],
    start: Array,
    times: Array,
    *,
    rtol: float,
    atol: Array | float,
    method: Literal["DOP853", "RK45"] = "DOP853",
    first_step: float | None = None,
    max_calls: int = 1_000_000,
) -> Array:
    """Return the solution of y_dot = rhs(t, y) at times[1:], shape (len(times) - 1, n).

    Parameters
    ----------
    start : (n,) state at times[0]
    times : ascending [s]
    rtol, atol : relative and absolute tolerance of a step
    max_calls : of `rhs`; a policy or plant that has become too stiff ends here instead of never

    Raises
    ------
    RunError
        If the integration fails, anything is not finite, or the calls are used up.
    """
    calls = 0

    def counted(t: float, y: Array) -> Array:
        nonlocal calls
        calls += 1
        if calls > max_calls:
            raise RunError(f"the integration became too stiff near t = {t:.2f} s")
        return rhs(t, y)

    span = (float(times[0]), float(times[-1]))
    answer = solve_ivp(
        counted, span, start, method, t_eval=times[1:], rtol=rtol, atol=atol, first_step=first_step
    )
    if not answer.success or not np.all(np.isfinite(answer.y)):
        raise RunError(f"the integration failed between t = {span[0]:.2f} and {span[1]:.2f} s")
    return np.asarray(answer.y.T)
