"""A vehicle: its published parameters, checked for physical sense on loading.

Body frame x forward, y starboard, z down (SNAME), origin CO, SI units. Added mass and damping are
positive magnitudes: D(ν) ν = (D_l + D_q diag(|ν|)) ν is dissipative.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
import scipy
from pydantic import ValidationInfo, field_validator, model_validator

from ..arrays import Array, Vector3
from ..toml import Settings, locate, read_toml, validate
from .plausible import Body, why_implausible
from .thrusters import Positive, Thrusters


def skew(r: Array | Vector3) -> Array:
    """Return S(r) with S(r) a = r x a. `r`: shape (3,)."""
    x, y, z = (float(c) for c in r)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class Vehicle(Settings):
    """Parameters of a fully actuated underwater vehicle.

    Attributes
    ----------
    mass [kg]; weight, buoyancy [N]; gravity [m/s^2]
    center_of_gravity, center_of_buoyancy : from CO [m]
    inertia : (3, 3) about CO [kg m^2]
    added_mass : (6, 6) [kg, kg m, kg m^2]
    linear_damping : (6,) or (6, 6) [N/(m/s), N m/(rad/s)]
    quadratic_damping : (6,) or (6, 6), multiplies diag(abs(ν)) [N/(m/s)^2, N m/(rad/s)^2]
    """

    name: str
    source: str
    units: Literal["SI"]
    mass: Positive
    weight: Positive
    buoyancy: Positive
    gravity: Positive = 9.81
    center_of_gravity: Vector3
    center_of_buoyancy: Vector3
    inertia: list[list[float]]
    added_mass: list[list[float]]
    linear_damping: list[float] | list[list[float]]
    quadratic_damping: list[float] | list[list[float]]
    thrusters: Thrusters | None = None

    @classmethod
    def load(cls, name: str | Path) -> Vehicle:
        """Load a shipped vehicle by name, or a user's by the path of its TOML file.

        Raises
        ------
        InputError
            If there is no such vehicle, or its file breaks a rule; one sentence says which.
        """
        path = locate(name, __package__, "vehicles", "vehicle")
        return validate(cls, read_toml(path), f"vehicle '{name}'")

    def replaced(self, parameters: Mapping[str, object], where: str) -> Vehicle:
        """Return the vehicle with some parameters replaced; `where` names it in a message.

        Raises
        ------
        InputError
            If there is no such parameter, or the vehicle breaks a rule with it.
        """
        if not parameters:
            return self
        return validate(Vehicle, self.model_dump(mode="json") | dict(parameters), where)

    @field_validator("name", "source")
    @classmethod
    def _readable(cls, text: str) -> str:
        if not text.strip() or not text.isprintable():
            raise ValueError(f"is {text!r}, but must be words that can be printed")
        return text

    @field_validator("inertia", "added_mass", mode="before")
    @classmethod
    def _square(cls, value: object, info: ValidationInfo) -> object:
        n = 3 if info.field_name == "inertia" else 6
        rows = value if isinstance(value, list) else []
        if [len(row) if isinstance(row, list) else 0 for row in rows] != [n] * n:
            raise ValueError(f"must be a {n}x{n} matrix, {n} rows of {n} numbers")
        return value

    @field_validator("center_of_gravity", "center_of_buoyancy", mode="before")
    @classmethod
    def _three(cls, value: object) -> object:
        if isinstance(value, list) and len(value) != 3:
            raise ValueError(f"is {value}, but must be 3 numbers in m")
        return value

    @field_validator("inertia", "added_mass")
    @classmethod
    def _symmetric(cls, rows: list[list[float]]) -> list[list[float]]:
        matrix = np.array(rows)
        gap = np.abs(matrix - matrix.T).max(initial=0.0)
        if gap > 1e-6 * np.abs(matrix).max(initial=1e-300):
            raise ValueError(
                f"must be symmetric, but two mirrored entries differ by {gap:.3g}; use their mean"
            )
        return rows

    @field_validator("linear_damping", "quadratic_damping")
    @classmethod
    def _damping_shape(cls, value: list[float] | list[list[float]]) -> object:
        lengths = {len(row) if isinstance(row, list) else 0 for row in value}
        if len(value) != 6 or lengths not in ({0}, {6}):
            raise ValueError("must have 6 entries (the diagonal) or be a 6x6 matrix")
        return value

    @model_validator(mode="after")
    def _physical(self) -> Vehicle:
        smallest = float(np.linalg.eigvalsh(self.rigid_body_inertia).min())
        if smallest <= 0.0:
            raise ValueError(
                "the rigid-body inertia must be positive definite, but its smallest eigenvalue is "
                f"{smallest:.4g}; check mass, inertia (about CO) and center_of_gravity"
            )
        fault = why_implausible(self.body)
        if fault is not None:
            raise ValueError(fault)
        smallest = float(np.linalg.eigvalsh(self.M).min())
        if smallest <= 0.0:
            raise ValueError(
                "M (rigid body and added mass) must be positive definite, but its smallest "
                f"eigenvalue is {smallest:.4g}; check mass, inertia and added_mass"
            )
        if float(np.linalg.eigvalsh(self.D_linear + self.D_linear.T).min()) < -1e-9:
            raise ValueError(
                "linear_damping must be dissipative (ν'D_l ν >= 0 for every ν), but it feeds energy "
                "in for some ν; give positive magnitudes"
            )
        power = _least_power(self.D_quadratic)
        if power < -1e-6:
            raise ValueError(
                "quadratic_damping must be dissipative (ν'D_q diag(|ν|) ν >= 0 for every ν), but it "
                "feeds energy in for some ν; give a positive diagonal that outweighs the rest"
            )
        return self

    @property
    def body(self) -> Body:
        """What has to fit together."""
        centers = ("center_of_gravity", "center_of_buoyancy")
        return Body(
            mass=self.mass,
            weight=self.weight,
            buoyancy=self.buoyancy,
            gravity=self.gravity,
            centers={name: np.array(getattr(self, name)) for name in centers},
            inertia=np.array(self.inertia),
            added_mass=self.M_added,
            allocation=None if self.thrusters is None else self.thrusters.matrix,
        )

    @property
    def rigid_body_inertia(self) -> Array:
        """M_RB about CO, shape (6, 6) (Fossen 2011, (3.44))."""
        S = skew(self.center_of_gravity)
        m = self.mass
        return np.block([[m * np.eye(3), -m * S], [m * S, np.array(self.inertia)]])

    @property
    def M(self) -> Array:
        """Inertia including added mass of (2), shape (6, 6)."""
        return self.rigid_body_inertia + self.M_added

    @property
    def M_added(self) -> Array:
        """Added mass M_A, shape (6, 6)."""
        return np.array(self.added_mass)

    @property
    def D_linear(self) -> Array:
        """D_l, shape (6, 6)."""
        return _as_matrix(self.linear_damping)

    @property
    def D_quadratic(self) -> Array:
        """D_q of D(ν) = D_l + D_q diag(|ν|), shape (6, 6)."""
        return _as_matrix(self.quadratic_damping)


def _as_matrix(value: list[float] | list[list[float]]) -> Array:
    array = np.array(value, dtype=float)
    return np.diag(array) if array.ndim == 1 else array


def _least_power(D_quadratic: Array, n_directions: int = 2000) -> float:
    """Return the least ν'D_q diag(|ν|) ν found, in units that make the diagonal of D_q one.

    Exact for a diagonal D_q; otherwise a local search from the best of many seeded directions. The
    units matter: a moment among forces would hide in a tiny cone.
    """
    diagonal = np.diag(D_quadratic)
    if not np.any(D_quadratic - np.diag(diagonal)):
        return float(diagonal.min())
    unit = np.maximum(diagonal, 1e-3 * np.abs(D_quadratic).max()) ** (-1.0 / 3.0)
    D = unit[:, None] * D_quadratic * unit**2

    def power(y: Array) -> float:
        return float(y @ D @ (np.abs(y) * y) / np.linalg.norm(y) ** 3)

    y = np.random.default_rng(0).standard_normal((n_directions, 6))
    y = np.vstack([y / np.linalg.norm(y, axis=1, keepdims=True), np.eye(6)])
    best = np.argsort(np.einsum("ni,ij,nj->n", y, D, np.abs(y) * y))[:10]
    return min(float(scipy.optimize.minimize(power, start).fun) for start in y[best])
