"""The shipped vehicles against what their sources say, and the thrusters' allocation."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.symbolic import Thrusters, Vehicle

from .fossen import SHIPPED, Body, read_parameters


@pytest.fixture(params=["bluerov2-heavy", "bluerov2-heavy-buoyant"])
def thrusters(request: pytest.FixtureRequest) -> Thrusters:
    """The layout of eight thrusters."""
    layout = Vehicle.load(request.param).thrusters
    assert layout is not None
    return layout


@pytest.mark.parametrize("name", SHIPPED)
def test_parameters_are_read_as_they_are_written(name: str) -> None:
    """M, D_l and D_q of the package and of the oracle's own reading of the file."""
    vehicle, body = Vehicle.load(name), Body(read_parameters(name))
    assert pytest.approx(body.M, rel=1e-15) == vehicle.M
    assert pytest.approx(body.A, rel=1e-15) == vehicle.M_added
    assert pytest.approx(body.D_l, rel=1e-15) == vehicle.D_linear
    assert pytest.approx(body.D_q, rel=1e-15) == vehicle.D_quadratic
    assert vehicle.gravity == pytest.approx(vehicle.weight / vehicle.mass, rel=1e-6)


def test_buoyancy_is_the_displaced_weight() -> None:
    """rho g V of the sources: 1000 * 9.82 * 0.0134 and 1028 * 9.81 * 1.83826; neutral means W = B."""
    published, rexrov = Vehicle.load("bluerov2-heavy-buoyant"), Vehicle.load("rexrov")
    assert published.buoyancy == pytest.approx(1000 * 9.82 * 0.0134, abs=0.005)
    assert rexrov.buoyancy == pytest.approx(1028 * 9.81 * 1.83826, rel=1e-9)
    neutral = Vehicle.load("bluerov2-heavy")
    assert neutral.buoyancy == neutral.weight == published.weight
    assert published.weight - published.buoyancy == pytest.approx(0.98)


def test_righting_moment_is_positive() -> None:
    """z down: the centre of buoyancy of every shipped vehicle is above its centre of gravity."""
    for name in SHIPPED:
        vehicle = Vehicle.load(name)
        assert vehicle.center_of_buoyancy[2] < vehicle.center_of_gravity[2]


@pytest.mark.parametrize(("speed", "forces"), [(0.25, (12, 14, 20)), (0.5, (42, 54, 64))])
def test_bluerov2_drag(speed: float, forces: tuple[float, float, float]) -> None:
    """Surge, sway and heave drag in N, as two published parameter sets agree on at low speed."""
    body = Body(read_parameters("bluerov2-heavy"))
    for axis, force in enumerate(forces):
        assert body.drag(speed * np.eye(6)[axis])[axis] == pytest.approx(force, abs=0.6)


def test_rexrov_inertia_is_turned_to_z_down() -> None:
    """A half turn about x from the published z-up frame: Ixy and Ixz change sign, Iyz does not."""
    z_up = np.array([[525.39, 1.44, 33.41], [1.44, 794.20, 2.60], [33.41, 2.60, 691.23]])
    half_turn = np.diag([1.0, -1.0, -1.0])
    expected = half_turn @ z_up @ half_turn
    assert pytest.approx(expected) == np.array(Vehicle.load("rexrov").inertia)


def test_allocation_follows_from_the_geometry(thrusters: Thrusters) -> None:
    """Each column is (direction, position x direction); four digits are printed.

    Horizontals at (±0.156, ±0.111, 0.085) m turned by 45 degrees, verticals at (±0.12, ±0.218, 0) m
    that push up (-z).
    """
    x, y = np.array([1, 1, -1, -1]), np.array([1, -1, 1, -1])
    position = np.zeros((8, 3))
    position[:4] = np.column_stack([0.156 * x, 0.111 * y, np.full(4, 0.085)])
    position[4:] = np.column_stack([0.12 * x, 0.218 * y, np.zeros(4)])
    direction = np.zeros((8, 3))
    direction[:4] = np.column_stack([x, -y * x * x, np.zeros(4)]) / np.sqrt(2.0)
    direction[4:, 2] = -1.0
    geometry = np.hstack([direction, np.cross(position, direction)]).T
    given = thrusters.matrix
    for column in geometry.T:
        matches = np.abs(given - column[:, None]).max(axis=0) < 1e-4
        assert matches.sum() == 1, column
    singular = np.linalg.svd(given, compute_uv=False)
    assert singular == pytest.approx([2.0, 1.42, 1.42, 0.43, 0.38, 0.24], abs=0.006)


def test_thrust_gives_the_wrench_with_the_least_norm(thrusters: Thrusters) -> None:
    """allocation @ thrust = wrench; adding anything from the null space only makes it longer."""
    rng = np.random.default_rng(0)
    wrenches = rng.uniform(-20.0, 20.0, (50, 6))
    thrusts = thrusters.thrust(wrenches)
    assert thrusts.shape == (50, 8)
    assert thrusts @ thrusters.matrix.T == pytest.approx(wrenches)
    null = np.linalg.svd(thrusters.matrix)[2][6:]
    assert np.abs(null @ thrusts.T).max() < 1e-12 * np.abs(thrusts).max() * 8
    assert thrusters.thrust(wrenches[0]) == pytest.approx(thrusts[0])
