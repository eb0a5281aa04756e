"""A plant under held inputs: one compiled step where its error allows it, otherwise scipy's."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
from casadi import MX

from ...symbolic.arrays import Array
from ...symbolic.compiled import export
from ...symbolic.integration import dormand_prince_error, dormand_prince_step, integrate


class HeldRates:
    """y_dot = rates(ζ, held inputs) with y = (ζ, further integrals that ζ does not depend on).

    Parameters
    ----------
    rates : function of zeta (n,) and the held inputs; its first result is y_dot
    size : (n + further,) of y, the unit of the absolute tolerance
    tolerance : relative
    compiled : False uses CasADi's virtual machine
    """

    def __init__(
        self, rates: casadi.Function, size: Array, tolerance: float, *, compiled: bool
    ) -> None:
        self.tolerance = tolerance
        self.absolute = tolerance * size
        step = _held_step(rates, len(size))
        self.evaluate = export(rates, compiled=compiled)[0]
        self._step = export(step, compiled=compiled, operations=step.n_instructions())[0]

    def one_step(self, y: Array, h: float, *held: Array) -> Array | None:
        """Return y after one step of DOP853 of length h [s], or None where its error is too large."""
        reached, error = self._step(y, h, self.absolute, self.tolerance, *held)
        # written so that what is not finite is not accepted
        return reached if error < 1.0 else None

    def integrated(
        self, start: float, end: float, y: Array, rates: Callable[[float, Array], Array]
    ) -> Array:
        """Return y at `end` [s] by scipy's DOP853; raises RunError as `integrate` does."""
        reached = integrate(
            rates,
            y,
            np.array([start, end]),
            rtol=self.tolerance,
            atol=self.absolute,
            first_step=end - start,
            max_calls=20_000,
        )[-1]
        return np.asarray(reached)


def _held_step(rates: casadi.Function, size: int) -> casadi.Function:
    """Return one step of DOP853 of the rates and its error, everything but the state held."""
    n = rates.numel_in(0)
    y, h = MX.sym("y", size), MX.sym("h")
    absolute, relative = MX.sym("absolute", size), MX.sym("relative")
    held = {name: MX.sym(name, *rates.size_in(name)) for name in rates.name_in()[1:]}

    def rate(point: MX) -> MX:
        return rates.call([point[:n], *held.values()])[0]

    reached, error_5, error_3 = dormand_prince_step(rate, y, h)
    scale = absolute + relative * casadi.fmax(casadi.fabs(y), casadi.fabs(reached))
    return casadi.Function(
        "held_step",
        [y, h, absolute, relative, *held.values()],
        [reached, dormand_prince_error(h, error_5, error_3, scale)],
        ["y", "h", "absolute", "relative", *held],
        ["reached", "error"],
    )
