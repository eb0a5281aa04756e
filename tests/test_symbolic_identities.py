"""Identities of the earth-frame dynamics: they hold for every vehicle, whatever its parameters."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from casadi import SX
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from stationkeep.symbolic import Model, Vehicle
from stationkeep.symbolic.underwater import dynamics, kinematics

from .fossen import PARAMETERS, SHIPPED, Body, jacobian, random_states, rotation

Array = NDArray[np.float64]


@pytest.fixture(params=[*PARAMETERS])
def name(request: pytest.FixtureRequest) -> str:
    """Name of each vehicle in turn."""
    return str(request.param)


@pytest.fixture
def vehicle(name: str) -> Vehicle:
    """The vehicle as the package reads it."""
    return Vehicle.load(name) if name in SHIPPED else Vehicle(**PARAMETERS[name])


def evaluate(expressions: list[SX], zeta: SX, states: Array) -> list[list[Array]]:
    """Return the values of expressions at each state."""
    function = casadi.Function("values", [zeta], expressions)
    return [[np.array(value) for value in function(state)] for state in states]


def test_rotation_is_composed_of_three_turns() -> None:
    """J_1 is R_z(psi) R_y(theta) R_x(phi), orthogonal with determinant 1."""
    eta = SX.sym("eta", 6)
    function = casadi.Function("rotation", [eta], [kinematics.rotation(eta)])
    for state in random_states(200):
        R = np.array(function(state[:6]))
        assert pytest.approx(rotation(state[3:6]), abs=1e-14) == R
        assert pytest.approx(np.eye(3), abs=1e-14) == R @ R.T
        assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)


def test_jacobian_and_its_inverse() -> None:
    """J is the oracle's, J J^-1 = I, and J_dot is the derivative of J along eta_dot."""
    zeta = SX.sym("zeta", 12)
    eta, eta_dot = zeta[:6], zeta[6:]
    J = kinematics.jacobian(eta)
    J_dot = casadi.reshape(casadi.jtimes(casadi.vec(J), eta, eta_dot), 6, 6)
    terms = [J, kinematics.jacobian_inverse(eta), kinematics.jacobian_dot(eta, eta_dot), J_dot]
    states = random_states(300)
    for state, values in zip(states, evaluate(terms, zeta, states), strict=True):
        given, inverse, rate, expected_rate = values
        assert pytest.approx(jacobian(state[:6]), abs=1e-13) == given
        assert pytest.approx(np.eye(6), abs=1e-13) == given @ inverse
        assert np.linalg.norm(rate - expected_rate) < 1e-12 * np.linalg.norm(expected_rate)


def test_kinematics_kernel_is_the_jacobian() -> None:
    """`Model.kinematics` returns J, not its transpose."""
    kernel = Model(Vehicle.load("bluerov2-heavy"), compiled=False).kinematics
    for state in random_states(20):
        (J,) = kernel(state[:6])
        assert pytest.approx(jacobian(state[:6]), abs=1e-13) == J


def test_M_bar_dot_minus_2_C_bar_is_skew(vehicle: Vehicle) -> None:
    """Property 2 of the paper; M_bar_dot by the directional derivative of M_bar along eta_dot."""
    zeta = SX.sym("zeta", 12)
    terms = dynamics.earth_frame(vehicle, zeta[:6], zeta[6:])
    rate = casadi.jtimes(casadi.vec(terms.M_bar), zeta[:6], zeta[6:])
    M_bar_dot = casadi.reshape(rate, 6, 6)
    for M_dot, C in evaluate([M_bar_dot, terms.C_bar], zeta, random_states(300)):
        assert np.linalg.norm(M_dot) > 0.0
        N = M_dot - 2.0 * C
        assert np.linalg.norm(N + N.T) < 1e-10 * np.linalg.norm(M_dot)


def test_M_bar_is_symmetric_positive_definite(vehicle: Vehicle) -> None:
    """Property 1 of the paper; the largest eigenvalue is bounded over all attitudes, up to the limit.

    |J^-1| <= sqrt(2): each Euler rate turns the body at its own speed, and roll and yaw may add up.
    """
    kernel = Model(vehicle, compiled=False).earth_frame
    bound = 2.0 * np.linalg.eigvalsh(vehicle.M).max()
    states = random_states(300)
    states[:, 4] *= 1.57 / 1.2
    for state in states:
        M_bar = kernel(state)[0]
        assert np.linalg.norm(M_bar - M_bar.T) < 1e-12 * np.linalg.norm(M_bar)
        eigenvalues = np.linalg.eigvalsh(M_bar)
        assert eigenvalues[0] > 0.0
        assert eigenvalues[-1] <= bound * (1 + 1e-12)


def test_dynamics_follow_from_the_energy(vehicle: Vehicle) -> None:
    """Euler-Lagrange: d/dt dT/d(eta_dot) - dT/d(eta) + dU/d(eta) + D_bar eta_dot = 0 at eta_ddot = f.

    T = 1/2 eta_dot'M_bar eta_dot and U from the depths of the two centres: C_bar and g_bar are not
    used, only M_bar (which is compared with the oracle elsewhere) and derivatives of the two energies.
    """
    zeta = SX.sym("zeta", 12)
    eta, eta_dot = zeta[:6], zeta[6:]
    terms = dynamics.earth_frame(vehicle, eta, eta_dot)
    R = kinematics.rotation(eta)
    depths = [
        eta[2] + (R @ casadi.DM(r))[2] for r in (vehicle.center_of_gravity, vehicle.center_of_buoyancy)
    ]
    T = casadi.dot(eta_dot, terms.M_bar @ eta_dot) / 2
    U = -vehicle.weight * depths[0] + vehicle.buoyancy * depths[1]
    momentum = casadi.gradient(T, eta_dot)
    eta_ddot = dynamics.drift(vehicle, zeta)[6:]
    inertial = casadi.jtimes(momentum, eta, eta_dot) + terms.M_bar @ eta_ddot
    forces = casadi.gradient(T, eta) - casadi.gradient(U, eta) - terms.D_bar @ eta_dot
    for left, right in evaluate([inertial, forces], zeta, random_states(300)):
        assert np.linalg.norm(left - right) < 1e-10 * np.linalg.norm(right)


def test_a_neutral_vehicle_rests_anywhere() -> None:
    """f(x, y, z, 0, 0, psi, 0) = 0 with W = B and the CG below the CB; the trim is then zero."""
    model = Model(Vehicle.load("bluerov2-heavy"), compiled=False)
    for x, y, z, psi in ([0, 0, 0, 0], [3, -2, 10, 2.5]):
        assert not model.drift([x, y, z, 0, 0, psi, 0, 0, 0, 0, 0, 0]).any()
    assert not model.u_trim.any()


@pytest.mark.parametrize("current", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.1)], ids=["still", "current"])
@pytest.mark.parametrize("name", ["bluerov2-heavy-buoyant", "rexrov", "synthetic"])
def test_trim_holds_the_origin(vehicle: Vehicle, current: tuple[float, float, float]) -> None:
    """f(0) + g(0) u_trim = 0 where f(0) is not 0."""
    model = Model(vehicle, current=current, compiled=False)
    origin = np.zeros(12)
    f = model.drift(origin)
    assert np.abs(f).max() > 1e-3
    residual = f + model.input_matrix(origin) @ model.u_trim
    assert np.abs(residual).max() < 1e-12 * np.abs(f).max()


@pytest.mark.parametrize("name", ["bluerov2-heavy-buoyant", "rexrov"])
def test_trim_in_still_water_is_the_missing_weight(vehicle: Vehicle) -> None:
    """With both centres under CO the trim is the single force B - W along z (down)."""
    expected = [0.0, 0.0, vehicle.buoyancy - vehicle.weight, 0.0, 0.0, 0.0]
    assert Model(vehicle, compiled=False).u_trim == pytest.approx(expected, abs=1e-9)


def test_trim_in_still_water_holds_at_every_heading() -> None:
    """Earth-frame forces don't turn with the vehicle, nor does the moment of a level one."""
    model = Model(Vehicle(**PARAMETERS["synthetic"]), compiled=False)
    for psi in (-2.0, 0.7, 3.0):
        rest = np.array([1, 2, 3, 0, 0, psi, 0, 0, 0, 0, 0, 0])
        assert model.drift(rest) + model.input_matrix(rest) @ model.u_trim == pytest.approx(
            np.zeros(12), abs=1e-12
        )


def free_decay(model: Model, body: Body, duration: float) -> tuple[Array, Array]:
    """Return the first and last ζ of a free motion, with the energy dissipated as 13th entry."""
    start = np.array([0, 0, 5, 0.3, -0.2, 0.5, 0.5, -0.4, 0.3, 0.4, 0.3, -0.5, 0])

    def rate(_: float, extended: Array) -> Array:
        zeta = extended[:12]
        return np.append(model.drift(zeta), body.dissipation(zeta))

    scale = np.abs(np.diag(body.M)).max()
    tolerance = np.append(np.full(12, 1e-11), 1e-11 * scale)
    answer = solve_ivp(rate, (0.0, duration), start, "DOP853", rtol=1e-11, atol=tolerance)
    assert answer.success
    return start, answer.y[:, -1]


def test_free_decay_loses_what_drag_takes(name: str, vehicle: Vehicle) -> None:
    """Kinetic and potential energy fall by the integral of nu'D(nu) nu."""
    body = Body(PARAMETERS[name])
    start, end = free_decay(Model(vehicle, compiled=False), body, 3.0)
    lost = body.energy(start[:12]) - body.energy(end[:12])
    assert end[12] > 0.1 * np.diag(body.M)[0] * 0.5**2 / 2  # there is something to compare
    assert lost == pytest.approx(end[12], rel=1e-7)


def test_without_damping_energy_is_conserved(name: str) -> None:
    """No damping, no loss; the motion itself is large."""
    parameters = PARAMETERS[name] | {"linear_damping": [0.0] * 6, "quadratic_damping": [0.0] * 6}
    body = Body(parameters)
    start, end = free_decay(Model(Vehicle(**parameters), compiled=False), body, 3.0)
    kinetic = 0.5 * body.M[0, 0] * 0.5**2
    assert np.abs(end[:12] - start[:12]).max() > 0.5
    assert abs(body.energy(end[:12]) - body.energy(start[:12])) < 1e-8 * kinetic
