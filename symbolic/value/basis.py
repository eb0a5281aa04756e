"""Bases σ(ζ) of the value function (10): V ≈ W'σ(ζ).

A basis is a function from the scaled state x = ζ / scale to expressions. The shipped ones:

- `quadratic`: the n(n+1)/2 monomials x_i x_j (78 for 12 states);
- `drag`: these and, for each axis with scaled position a and velocity b, eleven functions that know
  that quadratic drag slows a fast vehicle down (144);
- `drag-cubic`: these and the products translation x translation x attitude (270).

σ(0) = 0 and σ'(0) = 0 are checked, so that V_hat(0) = 0 and the policies vanish at the origin.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from types import MappingProxyType

import casadi
import numpy as np
from casadi import DM, SX

from ..arrays import Array
from ..errors import InputError, nearest
from ..pyfile import find_callable, one_line

BasisFunction = Callable[[SX], SX]


def quadratic(x: SX) -> SX:
    """Return the monomials x_i x_j with i <= j, shape (n(n+1)/2,)."""
    pairs = combinations_with_replacement(range(x.shape[0]), 2)
    return casadi.vertcat(*(x[i] * x[j] for i, j in pairs))


def drag(x: SX) -> SX:
    """Return the quadratic monomials and eleven drag-aware functions an axis: 144 for 12 states.

    For states (η, η_dot), k axes. With a = x_i, b = x_{i+k}: s = 1/sqrt(1 + (b/.3)^2) falls where drag
    dominates, and h = sqrt(1 + (a/.3)^2) grows like |a|, since far away the way back is paid per metre.

    Raises
    ------
    InputError
        If the number of states is odd.
    """
    axes = _axes(x, "drag", 1)
    terms = [quadratic(x)]
    for i in range(axes):
        a, b = x[i], x[i + axes]
        s = 1 / casadi.sqrt(1 + (b / 0.3) ** 2)
        h = casadi.sqrt(1 + (a / 0.3) ** 2)
        terms += [a**2 * h, a**2 / h, a * b * s, a * b * h, a * b / h, b**2 * s, b**2 * s**2]
        terms += [a**2 * s, a * b * s * h, b**2 * s * h, b**2 * h]
    return casadi.vertcat(*terms)


def drag_cubic(x: SX) -> SX:
    """Return `drag` and the products translation x translation x attitude: 270 for 12 states.

    Of states (η, η_dot) whose axes are translations in their first half and angles in the other.

    Raises
    ------
    InputError
        If the number of axes is odd.
    """
    axes = _axes(x, "drag-cubic", 2)
    half = axes // 2
    translation = [x[j + i] for j in (0, axes) for i in range(half)]
    attitude = [x[j + i] for j in (half, axes + half) for i in range(half)]
    pairs = combinations_with_replacement(translation, 2)
    return casadi.vertcat(drag(x), *(a * b * c for a, b in pairs for c in attitude))


SHIPPED: Mapping[str, BasisFunction] = MappingProxyType(
    {"quadratic": quadratic, "drag": drag, "drag-cubic": drag_cubic}
)


@dataclass(frozen=True, eq=False)
class Basis:
    """σ as an expression of the state.

    Attributes
    ----------
    name : shown in messages and files
    zeta : (n,) symbol
    sigma : (m,) expression of `zeta`
    scale : (n,) with x = ζ / scale

    Raises
    ------
    InputError
        If σ(0) or σ'(0) is not zero (or not finite).
    """

    name: str
    zeta: SX
    sigma: SX
    scale: Array

    def __post_init__(self) -> None:
        at_origin = self._evaluate(casadi.horzcat(self.sigma, self.jacobian), np.zeros(self.n))
        for label, value in (("sigma(0)", at_origin[:, 0]), ("sigma'(0)", at_origin[:, 1:])):
            worst = np.abs(value).max()
            if not worst < 1e-12:
                raise InputError(
                    f"basis '{self.name}': {label} must be 0, but its largest entry is {worst:.3g}; "
                    "use functions of at least second order at the origin"
                )

    @classmethod
    def build(cls, name: str, function: BasisFunction, zeta: SX, scale: Array) -> Basis:
        """Build a basis from a function of the scaled state.

        Raises
        ------
        InputError
            If the function does not return a column of expressions.
        """
        try:
            sigma = function(zeta / DM(scale))
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"basis '{name}': the function raises {one_line(error)}") from error
        if not isinstance(sigma, SX) or sigma.shape[1] != 1 or sigma.shape[0] == 0:
            raise InputError(
                f"basis '{name}': the function must return one column of casadi.SX expressions, "
                "for instance casadi.vertcat(x[0]**2, x[0]*x[1])"
            )
        return cls(name, zeta, casadi.densify(sigma), scale)

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.zeta.shape[0])

    @property
    def n_basis(self) -> int:
        """Number of functions m."""
        return int(self.sigma.shape[0])

    @cached_property
    def jacobian(self) -> SX:
        """σ'(ζ), shape (m, n), dense."""
        return casadi.densify(casadi.jacobian(self.sigma, self.zeta))

    def quadratic_weights(self, P: Array) -> Array:
        """Return the weights with W'σ(ζ) = ζ'P ζ, shape (m,).

        Least squares over seeded points in the gradient; exact when the monomials are in the basis.

        Raises
        ------
        InputError
            If no weights represent ζ'P ζ to 1e-6 of its gradient (rms).
        """
        sigma_prime = casadi.Function("sigma_prime", [self.zeta], [self.jacobian])
        rng = np.random.default_rng(0)
        x = rng.uniform(-1.0, 1.0, (4 * self.n_basis // self.n + 20, self.n))
        rows = [np.array(sigma_prime(point * self.scale)).T * self.scale[:, None] for point in x]
        target = 2.0 * (x * self.scale) @ P * self.scale
        design = np.vstack(rows)
        weights, *_ = np.linalg.lstsq(design, target.ravel(), rcond=None)
        error = np.linalg.norm(design @ weights - target.ravel()) / np.linalg.norm(target)
        if error > 1e-6:
            raise InputError(
                f"basis '{self.name}' can't represent the Riccati value (error {error:.2g}); include "
                "the quadratic monomials, stationkeep.symbolic.quadratic(x)"
            )
        return np.asarray(weights)

    def _evaluate(self, expression: SX, point: Array) -> Array:
        value = casadi.Function("evaluate", [self.zeta], [expression])(point)
        return np.array(DM(value).full(), dtype=float)


def find_function(name: str) -> BasisFunction:
    """Return a shipped basis function by name, or a user's by 'path/to/file.py:function'.

    Raises
    ------
    InputError
        If it can't be found or its file can't be loaded.
    """
    if name in SHIPPED:
        return SHIPPED[name]
    if ":" not in name:
        raise InputError(
            f"there is no basis '{name}': {nearest(name, SHIPPED)} (or give file.py:function)"
        )
    return find_callable(name, "the basis")


def _axes(x: SX, name: str, multiple: int) -> int:
    """Return the number of axes of states (η, η_dot), which has to be a multiple."""
    axes, odd = divmod(x.shape[0], 2)
    if odd or axes % multiple:
        kind = "positions and their rates" if multiple == 1 else "translations, angles and their rates"
        raise InputError(
            f"basis '{name}' is for {kind}, {2 * multiple} states a group, but there are "
            f"{x.shape[0]}; use 'quadratic'"
        )
    return axes
