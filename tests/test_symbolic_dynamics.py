"""f, g and the plant against an independently written Fossen model (`fossen.py`)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from stationkeep.symbolic import Model, Vehicle

from .fossen import PARAMETERS, SHIPPED, Body, jacobian, random_states

CURRENT = (0.3, -0.2, 0.1)  # m/s
Array = NDArray[np.float64]


@pytest.fixture(params=[*PARAMETERS])
def name(request: pytest.FixtureRequest) -> str:
    """Name of each vehicle in turn."""
    return str(request.param)


@pytest.fixture
def body(name: str) -> Body:
    """The oracle of the vehicle."""
    return Body(PARAMETERS[name])


@pytest.fixture
def vehicle(name: str) -> Vehicle:
    """The vehicle as the package reads it."""
    return Vehicle.load(name) if name in SHIPPED else Vehicle(**PARAMETERS[name])


def worst_error(given: list[Array], expected: list[Array]) -> float:
    """Return the largest norm-relative difference over the points."""
    pairs = zip(given, expected, strict=True)
    return max(float(np.linalg.norm(a - b) / np.linalg.norm(b)) for a, b in pairs)


@pytest.mark.parametrize("current", [(0.0, 0.0, 0.0), CURRENT], ids=["still", "current"])
def test_drift_is_fossens(vehicle: Vehicle, body: Body, current: tuple[float, float, float]) -> None:
    """f of (3) is the free acceleration of the oracle, in still water and in a steady current."""
    model = Model(vehicle, current=current, compiled=False)
    states = random_states()
    f = [model.drift(zeta) for zeta in states]
    expected = [body.acceleration(zeta, water_velocity=current) for zeta in states]
    assert worst_error([value[6:] for value in f], expected) < 1e-10
    assert all(np.array_equal(value[:6], zeta[6:]) for value, zeta in zip(f, states, strict=True))


def test_input_matrix_is_fossens(vehicle: Vehicle, body: Body) -> None:
    """g of (3) is zero above and J M^-1 J' below."""
    model = Model(vehicle, compiled=False)
    states = random_states()
    g = [model.input_matrix(zeta) for zeta in states]
    assert all(not value[:6].any() for value in g)
    assert worst_error([v[6:] for v in g], [body.input_matrix(z[:6]) for z in states]) < 1e-10


def test_input_is_an_earth_frame_force(vehicle: Vehicle, body: Body) -> None:
    """A body wrench tau changes eta_ddot by g J^-T tau: u = J^-T tau is what g multiplies."""
    model = Model(vehicle, compiled=False)
    wrench = np.array([30.0, -20.0, 10.0, 2.0, -3.0, 1.0])
    states = random_states(100)
    forced = [
        (model.drift(z) + model.input_matrix(z) @ np.linalg.solve(jacobian(z[:6]).T, wrench))[6:]
        for z in states
    ]
    assert worst_error(forced, [body.acceleration(z, wrench) for z in states]) < 1e-10


def test_plant_is_fossens(vehicle: Vehicle, body: Body) -> None:
    """The plant under both wrenches in water that moves and accelerates."""
    plant = Model(vehicle, compiled=False).plant
    rng = np.random.default_rng(2)
    unit = np.diag(body.M)  # a wrench of about 1 m/s^2 and 1 rad/s^2
    given, expected = [], []
    for zeta in random_states():
        tau_b, tau_d = rng.uniform(-unit, unit), rng.uniform(-unit, unit)
        v_c, a_c = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 3)
        (zeta_dot,) = plant(zeta, tau_b, tau_d, v_c, a_c)
        given.append(zeta_dot[6:])
        expected.append(body.acceleration(zeta, tau_b + tau_d, v_c, a_c))
        assert np.array_equal(zeta_dot[:6], zeta[6:])
    assert worst_error(given, expected) < 1e-10


def test_earth_frame_matrices_are_fossens(vehicle: Vehicle, body: Body) -> None:
    """M_bar, D_bar eta_dot and g_bar are the oracle's, and with C_bar they give its motion."""
    kernel = Model(vehicle, compiled=False).earth_frame
    for zeta in random_states(200):
        M_bar, C_bar, D_bar, g_bar = kernel(zeta)
        J = jacobian(zeta[:6])
        J_inverse = np.linalg.inv(J)
        assert worst_error([M_bar], [J_inverse.T @ body.M @ J_inverse]) < 1e-10
        drag = J_inverse.T @ body.drag(J_inverse @ zeta[6:])
        assert worst_error([D_bar @ zeta[6:]], [drag]) < 1e-10
        restoring = -J_inverse.T @ body.hydrostatic(J[:3, :3])
        assert worst_error([g_bar], [restoring]) < 1e-10
        eta_ddot = -np.linalg.solve(M_bar, (C_bar + D_bar) @ zeta[6:] + g_bar)
        assert worst_error([eta_ddot], [body.acceleration(zeta)]) < 1e-10


def test_a_steady_current_is_a_moving_observer(vehicle: Vehicle) -> None:
    """Galilei: in a steady current the vehicle accelerates as in still water at the relative speed."""
    model, still = Model(vehicle, current=CURRENT, compiled=False), Model(vehicle, compiled=False)
    states = random_states(200)
    relative = states - np.concatenate([np.zeros(6), CURRENT, np.zeros(3)])
    given = [model.drift(zeta)[6:] for zeta in states]
    assert worst_error(given, [still.drift(zeta)[6:] for zeta in relative]) < 1e-10


def test_accelerating_water_is_changed_gravity() -> None:
    """Einstein's lift: water that accelerates downwards at g makes weight and buoyancy vanish.

    In the falling frame gravity is zero, so a body that displaces water falls with it: the
    acceleration is g for any weight, buoyancy and centres, when W = m g.
    """
    for name in ("bluerov2-heavy-buoyant", "rexrov", "synthetic"):
        parameters = dict(PARAMETERS[name])
        g = parameters["gravity"]
        parameters["weight"] = parameters["mass"] * g
        plant = Model(Vehicle(**parameters), compiled=False).plant
        eta = np.array([1.0, -2.0, 3.0, 0.4, -0.7, 2.0])
        at_rest = np.concatenate([eta, np.zeros(6)])
        (zeta_dot,) = plant(at_rest, np.zeros(6), np.zeros(6), np.zeros(3), [0.0, 0.0, g])
        assert zeta_dot[6:] == pytest.approx([0.0, 0.0, g, 0.0, 0.0, 0.0], abs=1e-10)
