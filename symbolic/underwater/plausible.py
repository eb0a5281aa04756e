"""What can't be a vehicle: numbers that are each allowed, but not together; most are wrong units.

Lengths are measured by the cube root of the displaced volume B / (ρ g) in fresh water. `REACH` of it is
half the length of a cylinder 28 times as long as it is wide: no part is farther away. The roll of such
a cylinder has a radius of gyration of 0.13 of it; `CORE` is a quarter of that. Parts of the published
vehicles tried (1.4 to 1,860 kg) reach to 1.1, their radii of gyration go from 0.2 to 1.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array

if TYPE_CHECKING:
    from .vehicle import Vehicle

DENSITY = 1000.0  # [kg/m^3], fresh water
REACH = 5.0  # times the cube root of the displaced volume
CORE = 0.03  # likewise
# factor between weight and mass times gravity: a sweep may vary the mass alone, pounds do not pass
WEIGHT = 1.5
BUOYANCY = 5.0  # factor between buoyancy and weight; what thrusters can hold is another question
ROUNDED = 1.02  # published moments of inertia are rounded


def why_implausible(vehicle: Vehicle) -> str | None:
    """Return why these parameters can't be those of one vehicle, in one sentence, or None."""
    rules: tuple[Callable[[Vehicle], Iterator[str]], ...] = _added_mass, _weight, _places, _inertia
    return next((fault for rule in rules for fault in rule(vehicle)), None)


def unit_length(vehicle: Vehicle) -> float:
    """Return the cube root of the displaced volume [m]."""
    return float((vehicle.buoyancy / (DENSITY * vehicle.gravity)) ** (1.0 / 3.0))


def _added_mass(vehicle: Vehicle) -> Iterator[str]:
    diagonal = np.diag(vehicle.M_added)
    if diagonal.min() < 0.0:
        yield (
            f"added_mass has {diagonal.min():.4g} on its diagonal: the SNAME derivatives X_udot and so "
            "on are negative; give M_A = -(X_udot, ...), which is not"
        )


def _weight(vehicle: Vehicle) -> Iterator[str]:
    due = vehicle.mass * vehicle.gravity
    if not 1.0 / WEIGHT <= vehicle.weight / due <= WEIGHT:
        yield (
            f"the weight is {vehicle.weight:g} N, but mass times gravity is {due:.4g} N; give the mass "
            "in kg and the weight in N"
        )
    if not 1.0 / BUOYANCY <= vehicle.buoyancy / vehicle.weight <= BUOYANCY:
        yield (
            f"the buoyancy is {vehicle.buoyancy:g} N at a weight of {vehicle.weight:g} N, more than "
            f"{BUOYANCY:g} times the one the other; give both in N"
        )


def _places(vehicle: Vehicle) -> Iterator[str]:
    reach = REACH * unit_length(vehicle)
    bound = f"{_size(vehicle)} reaches {reach:.2g} m at most; give metres"
    for key in ("center_of_gravity", "center_of_buoyancy"):
        distance = float(np.linalg.norm(getattr(vehicle, key)))
        if distance > reach:
            yield f"{key} is {distance:.4g} m from CO, but {bound}"
    if vehicle.thrusters is not None:
        allocation = vehicle.thrusters.matrix
        force = np.maximum(np.linalg.norm(allocation[:3], axis=0), 1.0)
        arms = np.linalg.norm(allocation[3:], axis=0) / force
        if arms.max() > reach:
            yield (
                f"thrusters.allocation gives thruster {int(arms.argmax()) + 1} an arm of "
                f"{arms.max():.4g} m, but {bound}"
            )


def _inertia(vehicle: Vehicle) -> Iterator[str]:
    moments = np.linalg.eigvalsh(central_inertia(vehicle))
    if moments[2] > ROUNDED * (moments[0] + moments[1]):
        shown = ", ".join(f"{moment:.4g}" for moment in moments)
        yield (
            f"the principal moments of inertia about the centre of gravity are {shown} kg m^2, but no "
            "body has one that exceeds the sum of the other two; check inertia (about CO)"
        )
    unit = unit_length(vehicle)
    radii = np.sqrt(moments / vehicle.mass)
    for radius, wrong in ((radii[2], radii[2] > REACH * unit), (radii[0], radii[0] < CORE * unit)):
        if wrong:
            yield (
                f"inertia and mass make a radius of gyration of {radius:.3g} m, but {_size(vehicle)} "
                f"has one between {CORE * unit:.2g} and {REACH * unit:.2g} m; give kg m^2"
            )


def central_inertia(vehicle: Vehicle) -> Array:
    """Return the inertia about the centre of gravity, shape (3, 3) [kg m^2]: Steiner's theorem."""
    r = np.array(vehicle.center_of_gravity)
    steiner = vehicle.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return np.asarray(np.array(vehicle.inertia) - steiner)


def _size(vehicle: Vehicle) -> str:
    return f"a vehicle that displaces {vehicle.buoyancy / (DENSITY * vehicle.gravity):.3g} m^3"
