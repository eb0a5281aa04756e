"""Parameters that can't be those of one vehicle are refused, with the number and its bound."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stationkeep.symbolic import InputError, Vehicle
from stationkeep.symbolic.underwater.plausible import CORE, REACH

CASES = Path(__file__).parent / "cases"
PUBLISHED = ("girona500", "lauv", "micro-auv", "saga", "videoray")
SHIPPED = ("bluerov2-heavy", "bluerov2-heavy-2024", "bluerov2-heavy-buoyant", "rexrov")
Check = Callable[[BaseException], str]

FAULTS = {
    "05-weight-in-kg": ["weight is 11.5 N", "112.8 N", "kg"],
    "05-inertia-kg-mm2": ["radius of gyration", "118 m", "0.0117 m^3", "kg m^2"],
    "05-inertia-triangle": ["0.1554, 0.1554, 5 kg m^2", "sum of the other two"],
    "05-cob-in-mm": ["center_of_buoyancy is 20 m", "1.1 m", "metres"],
    "05-thr-alloc-in-mm": ["thruster 4", "100 m", "metres"],
    "vehicles/bluerov2-six-thrusters": [
        "6 thrusters",
        "M (pitch)",
        "rank 5",
        "add",
        "leave the thrusters out",
    ],
    "vehicles/minerva-five-thrusters": ["5 thrusters", "M (pitch)", "rank 5", "add"],
}


@pytest.mark.parametrize("name", FAULTS)
def test_the_number_and_its_bound_are_named(name: str, one_sentence: Check) -> None:
    path = CASES / f"{name}.toml"
    with pytest.raises(InputError) as caught:
        Vehicle.load(path)
    text = one_sentence(caught.value).replace(str(path), "FILE")
    for word in FAULTS[name]:
        assert word in text, text


@pytest.mark.parametrize("name", [*SHIPPED, *PUBLISHED])
def test_published_vehicles_are_far_from_the_bounds(name: str) -> None:
    """Nothing of them is within a factor of two of a bound."""
    vehicle = Vehicle.load(CASES / "vehicles" / f"{name}.toml" if name in PUBLISHED else name)
    unit, moments = vehicle.body.unit, np.linalg.eigvalsh(vehicle.body.central_inertia)
    radii = np.sqrt(moments / vehicle.mass)
    assert 2.0 * CORE * unit < radii.min() <= radii.max() < 0.5 * REACH * unit
    assert moments[2] < moments[0] + moments[1]
    assert vehicle.thrusters is None or np.abs(vehicle.thrusters.matrix[3:]).max() < 0.5 * REACH * unit


def test_the_bounds_are_those_of_a_slender_cylinder() -> None:
    """Length L = 28 D: V = π/4 D² L, roll m D²/8, half the length L/2."""
    D = 1.0
    volume = np.pi / 4.0 * D**2 * 28.0 * D
    assert 14.0 * D / np.cbrt(volume) == pytest.approx(REACH, rel=2e-3)
    assert np.sqrt(D**2 / 8.0) / np.cbrt(volume) / 4.0 == pytest.approx(CORE, rel=0.06)


def test_the_triangle_holds_at_the_centre_of_gravity_not_at_the_origin() -> None:
    """A dumb-bell along x: 0, a, a about its centre; about a point beside it all three differ."""
    vehicle = Vehicle.load("bluerov2-heavy")
    m, r = vehicle.mass, np.array([0.0, 0.0, 0.1])
    about_center = np.diag([0.1, 0.3, 0.35])
    steiner = m * (r @ r * np.eye(3) - np.outer(r, r))
    moved = vehicle.replaced(
        {"center_of_gravity": r.tolist(), "inertia": (about_center + steiner).tolist()}, "moved"
    )
    assert moved.body.central_inertia == pytest.approx(about_center, abs=1e-12)
    flat = np.diag([0.1, 0.2, 0.35]) + steiner
    with pytest.raises(InputError, match="sum of the other two"):
        vehicle.replaced({"center_of_gravity": r.tolist(), "inertia": flat.tolist()}, "flat")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": 29.76}, ["weight", "mass times gravity"]),  # 13.5 kg in pounds
        ({"buoyancy": 13.5}, ["buoyancy is 13.5 N", "5 times"]),
        ({"center_of_gravity": [0.0, 0.0, 2.0], "inertia": (60.0 * np.eye(3)).tolist()}, ["from CO"]),
        ({"inertia": (1e-6 * np.eye(3)).tolist()}, ["radius of gyration"]),  # t m^2
    ],
)
def test_other_units(changes: dict[str, object], words: list[str], one_sentence: Check) -> None:
    with pytest.raises(InputError) as caught:
        Vehicle.load("bluerov2-heavy").replaced({"center_of_gravity": [0, 0, 0]} | changes, "it")
    assert all(word in one_sentence(caught.value) for word in words), caught.value


def test_added_mass_that_outweighs_its_diagonal_is_refused() -> None:
    vehicle = Vehicle.load("bluerov2-heavy")
    added = vehicle.M_added
    added[0, 1] = added[1, 0] = 60.0
    with pytest.raises(InputError, match=r"M \(rigid body and added mass\) must be positive definite"):
        vehicle.replaced({"added_mass": added.tolist()}, "it")
