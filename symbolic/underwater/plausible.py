"""What can't be a vehicle: numbers that are each allowed, but not together; most are wrong units.

Lengths are measured by the cube root of the displaced volume B / (ρ g) in fresh water. `REACH` of it is
half the length of a cylinder 28 times as long as it is wide: no part is farther away. The roll of such
a cylinder has a radius of gyration of 0.13 of it; `CORE` is a quarter of that. Parts of the published
vehicles tried (1.4 to 1,860 kg) reach to 1.1, their radii of gyration go from 0.2 to 1.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Array

DENSITY = 1000.0  # [kg/m^3], fresh water
REACH = 5.0  # times the cube root of the displaced volume
CORE = 0.03  # likewise
# factor between weight and mass times gravity: a sweep may vary the mass alone, pounds do not pass
WEIGHT = 1.5
BUOYANCY = 5.0  # factor between buoyancy and weight; what thrusters can hold is another question
ROUNDED = 1.02  # published moments of inertia are rounded


@dataclass(frozen=True)
class Body:
    """What is to be one vehicle.

    Attributes
    ----------
    mass [kg]; weight, buoyancy [N]; gravity [m/s^2]
    centers : by their names, each (3,) from CO [m]
    inertia : (3, 3) about CO [kg m^2]
    added_mass : (6, 6)
    allocation : (6, n_thrusters), None without thrusters
    """

    mass: float
    weight: float
    buoyancy: float
    gravity: float
    centers: dict[str, Array]
    inertia: Array
    added_mass: Array
    allocation: Array | None

    @property
    def volume(self) -> float:
        """Displaced volume [m^3]."""
        return self.buoyancy / (DENSITY * self.gravity)

    @property
    def unit(self) -> float:
        """Cube root of the displaced volume [m]."""
        return float(self.volume ** (1.0 / 3.0))

    @property
    def central_inertia(self) -> Array:
        """Inertia about the centre of gravity, shape (3, 3) [kg m^2]: Steiner's theorem."""
        r = self.centers["center_of_gravity"]
        return np.asarray(self.inertia - self.mass * (r @ r * np.eye(3) - np.outer(r, r)))


def why_implausible(body: Body) -> str | None:
    """Return why these parameters can't be those of one vehicle, in one sentence, or None."""
    rules: tuple[Callable[[Body], Iterator[str]], ...] = _added_mass, _weight, _places, _inertia
    return next((fault for rule in rules for fault in rule(body)), None)


def _added_mass(body: Body) -> Iterator[str]:
    least = float(np.diag(body.added_mass).min())
    if least < 0.0:
        yield (
            f"added_mass has {least:.4g} on its diagonal: the SNAME derivatives X_udot and so on are "
            "negative; give M_A = -(X_udot, ...), which is not"
        )


def _weight(body: Body) -> Iterator[str]:
    due = body.mass * body.gravity
    if not 1.0 / WEIGHT <= body.weight / due <= WEIGHT:
        yield (
            f"the weight is {body.weight:g} N, but mass times gravity is {due:.4g} N; give the mass in "
            "kg and the weight in N"
        )
    if not 1.0 / BUOYANCY <= body.buoyancy / body.weight <= BUOYANCY:
        yield (
            f"the buoyancy is {body.buoyancy:g} N at a weight of {body.weight:g} N, more than "
            f"{BUOYANCY:g} times the one the other; give both in N"
        )


def _places(body: Body) -> Iterator[str]:
    reach = REACH * body.unit
    bound = f"{_size(body)} reaches {reach:.2g} m at most; give metres"
    for name, center in body.centers.items():
        distance = float(np.linalg.norm(center))
        if distance > reach:
            yield f"{name} is {distance:.4g} m from CO, but {bound}"
    if body.allocation is not None:
        force = np.maximum(np.linalg.norm(body.allocation[:3], axis=0), 1.0)
        arms = np.linalg.norm(body.allocation[3:], axis=0) / force
        if arms.max() > reach:
            yield (
                f"thrusters.allocation gives thruster {int(arms.argmax()) + 1} an arm of "
                f"{arms.max():.4g} m, but {bound}"
            )


def _inertia(body: Body) -> Iterator[str]:
    moments = np.linalg.eigvalsh(body.central_inertia)
    if moments[2] > ROUNDED * (moments[0] + moments[1]):
        shown = ", ".join(f"{moment:.4g}" for moment in moments)
        yield (
            f"the principal moments of inertia about the centre of gravity are {shown} kg m^2, but no "
            "body has one that exceeds the sum of the other two; check inertia (about CO)"
        )
    radii, low, high = np.sqrt(moments / body.mass), CORE * body.unit, REACH * body.unit
    for radius, wrong in ((radii[2], radii[2] > high), (radii[0], radii[0] < low)):
        if wrong:
            yield (
                f"inertia and mass make a radius of gyration of {radius:.3g} m, but {_size(body)} has "
                f"one between {low:.2g} and {high:.2g} m; give kg m^2"
            )


def _size(body: Body) -> str:
    return f"a vehicle that displaces {body.volume:.3g} m^3"
