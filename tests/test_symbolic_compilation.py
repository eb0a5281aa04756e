"""Compiled functions: equal to their symbolic source, and laid out as promised."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from numpy.typing import NDArray
from stationkeep.symbolic import (
    Basis,
    Export,
    Kernel,
    Model,
    Problem,
    ValueFunctions,
    Vehicle,
    find_function,
    quadratic,
    two_state_game,
)
from stationkeep.symbolic.compiled.compilation import find_compiler
from stationkeep.symbolic.underwater import dynamics, kinematics

from .fossen import PARAMETERS, random_states

Array = NDArray[np.float64]
N_SAMPLES = 5
BASES = ("quadratic", "drag", "drag-cubic")
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler")


@pytest.fixture(scope="module")
def model() -> Model:
    """The vehicle without symmetries in a current, compiled."""
    return Model(Vehicle(**PARAMETERS["synthetic"]), current=(0.3, -0.2, 0.1))


@pytest.fixture(scope="module", params=BASES)
def functions(request: pytest.FixtureRequest, reference_problem: Problem) -> ValueFunctions:
    """The learner's functions on the shipped game, compiled."""
    problem = reference_problem
    basis = Basis.build(request.param, find_function(request.param), problem.zeta, problem.scale)
    return ValueFunctions(problem, basis)


def worst(
    kernel: Kernel, source: casadi.Function, arguments: Iterator[list[Array]], n_points: int = 20
) -> float:
    """Return the largest norm-relative difference of a kernel to CasADi's own call of its source."""
    worst = 0.0
    for _ in range(n_points):
        values = next(arguments)
        given, expected = kernel(*values), source.call([DM(value) for value in values])
        for a, b in zip(given, expected, strict=True):
            full = b.full() if a.ndim == 2 else b.full().ravel()
            assert a.shape == full.shape
            assert np.linalg.norm(full) > 0.0
            worst = max(worst, float(np.linalg.norm(a - full) / np.linalg.norm(full)))
    return worst


def uniform(source: casadi.Function) -> Iterator[list[Array]]:
    """Yield random arguments of a function's shapes; the pitch stays inside ±1 rad."""
    rng = np.random.default_rng(11)
    while True:
        yield [rng.uniform(-1.0, 1.0, source.size_in(i)).squeeze() for i in range(source.n_in())]


def sources(model: Model) -> dict[str, casadi.Function]:
    """Return every function of a model again, as the expressions say, never compiled."""
    vehicle, zeta, current = model.vehicle, SX.sym("zeta", 12), model.current
    eta, tau_b, tau_d = SX.sym("eta", 6), SX.sym("b", 6), SX.sym("d", 6)
    v_c, a_c = SX.sym("v", 3), SX.sym("a", 3)
    f, g = dynamics.drift(vehicle, zeta, current), dynamics.input_matrix(vehicle, zeta)
    earth = dynamics.earth_frame(vehicle, zeta[:6], zeta[6:])
    eta_ddot = dynamics.acceleration(vehicle, zeta, tau_b + tau_d, v_c, a_c)
    moving = [zeta, tau_b, tau_d, v_c, a_c]
    table: dict[str, tuple[list[SX], list[SX]]] = {
        "drift": ([zeta], [f]),
        "input_matrix": ([zeta], [g]),
        "drift_jacobian": ([zeta], [casadi.jacobian(f, zeta)]),
        "input_matrix_jacobian": ([zeta], [casadi.jacobian(casadi.vec(g), zeta)]),
        "plant": (moving, [casadi.vertcat(zeta[6:], eta_ddot)]),
        "kinematics": ([eta], [kinematics.jacobian(eta)]),
        "earth_frame": ([zeta], [earth.M_bar, earth.C_bar, earth.D_bar, earth.g_bar]),
    }
    return {name: casadi.Function(name, *io) for name, io in table.items()}


def check_exports(exports: list[Export], names: set[str]) -> None:
    """Check that every function is there, was compiled and says how near to its source it is."""
    assert {export.name for export in exports} == names
    for export in exports:
        assert export.compiled, export.name
        assert len(export.key or "") == 64
        assert 0.0 <= export.max_difference <= 1e-12
        assert export.operations > 0
        assert export.inputs
        assert export.outputs


@needs_compiler
def test_every_function_of_a_model_is_its_source(model: Model) -> None:
    """Compiled = symbolic to 1e-12, for all that `exports` lists."""
    expected = sources(model)
    check_exports(list(model.exports()), set(expected))
    for name, source in expected.items():
        private = "_" if name in ("drift", "input_matrix") else ""
        kernel = getattr(model, private + name)
        assert worst(kernel, source, uniform(source)) < 1e-12, name


@needs_compiler
def test_model_methods_use_the_compiled_functions(model: Model) -> None:
    """`drift`, `input_matrix` and their Jacobians, compiled and in the virtual machine."""
    machine = Model(model.vehicle, model.current, compiled=False)
    for zeta in random_states(50):
        for name in ("drift", "input_matrix"):
            given, expected = getattr(model, name)(zeta), getattr(machine, name)(zeta)
            assert given.shape == expected.shape
            assert np.linalg.norm(given - expected) <= 1e-12 * np.linalg.norm(expected)
    assert not any(export.compiled for export in machine.exports())


def test_jacobians_of_the_model(model: Model) -> None:
    """df/dζ and dvec(g)/dζ (columns of g stacked) against fourth-order central differences."""
    for zeta in random_states(10, seed=5):
        h = 1e-4

        def difference(function: Callable[[Array], Array], direction: Array) -> Array:
            step = 1e-4 * direction
            near = function(zeta + step) - function(zeta - step)  # noqa: B023
            far = function(zeta + 2 * step) - function(zeta - 2 * step)  # noqa: B023
            return np.asarray((8.0 * near - far) / 12.0)

        (f_zeta,), (g_zeta,) = model.drift_jacobian(zeta), model.input_matrix_jacobian(zeta)
        columns = [difference(model.drift, e) / h for e in np.eye(12)]
        assert np.linalg.norm(np.column_stack(columns) - f_zeta) < 1e-7 * np.linalg.norm(f_zeta)
        columns = [difference(model.input_matrix, e).ravel(order="F") / h for e in np.eye(12)]
        assert np.linalg.norm(np.column_stack(columns) - g_zeta) < 1e-7 * np.linalg.norm(g_zeta)


@pytest.mark.slow
@needs_compiler
def test_every_value_function_is_its_source(functions: ValueFunctions) -> None:
    """σ, σ', the policies and the sample kernel, for each basis."""
    names = {"sigma", "sigma_prime", "policies", "sample_kernel"}
    check_exports(list(functions.exports(N_SAMPLES)), names)
    problem, basis, zeta = functions.problem, functions.basis, functions.problem.zeta
    game, m = problem.game, basis.n_basis
    a_1, a_2 = SX.sym("a_1", m), SX.sym("a_2", m)
    g_sigma = problem.input_matrix.T @ basis.jacobian.T
    u_1 = -0.5 * DM(np.linalg.inv(game.R)) @ g_sigma @ a_1
    u_2 = 0.5 / game.gamma**2 * DM(np.linalg.inv(game.W_d)) @ g_sigma @ a_2
    for kernel, inputs, outputs in (
        (functions.sigma, [zeta], [basis.sigma]),
        (functions.sigma_prime, [zeta], [basis.jacobian]),
        (functions.policies, [zeta, a_1, a_2], [u_1, u_2]),
    ):
        source = casadi.Function("source", inputs, outputs)
        assert worst(kernel, source, uniform(source)) < 1e-12


@needs_compiler
def test_sample_kernel_is_its_source(functions: ValueFunctions) -> None:
    """`at` gives f (N, n), g (N, n, k) and σ' (N, m, n): each point as if it were evaluated alone."""
    problem, basis = functions.problem, functions.basis
    outputs = [problem.drift, problem.input_matrix, basis.jacobian]
    alone = casadi.Function("alone", [problem.zeta], outputs)
    rng = np.random.default_rng(12)
    for n_points in (1, N_SAMPLES):
        points = rng.uniform(-1.0, 1.0, (n_points, 12)) * problem.scale
        terms = functions.at(points)
        assert terms.f.shape == (n_points, 12)
        assert terms.g.shape == (n_points, 12, 6)
        assert terms.sigma_prime.shape == (n_points, basis.n_basis, 12)
        for i, point in enumerate(points):
            f, g, sigma_prime = (np.array(value) for value in alone(point))
            assert terms.f[i] == pytest.approx(f.ravel(), rel=1e-12, abs=1e-14)
            assert terms.g[i] == pytest.approx(g, rel=1e-12, abs=1e-14)
            assert terms.sigma_prime[i] == pytest.approx(sigma_prime, rel=1e-12, abs=1e-14)


def test_sample_layout_of_a_small_game() -> None:
    """The same layout for 2 states, 1 input and 3 functions, where shapes could be mistaken."""
    problem = two_state_game()
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.array([1.0, 1.0]))
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (4, 2))
    for n_points in (1, 4):
        functions = ValueFunctions(problem, basis, compiled=False)
        terms = functions.at(points[:n_points])
        for i, (x_1, x_2) in enumerate(points[:n_points]):
            c = np.cos(2 * x_1) + 2
            f = [-x_1 + x_2, -x_1 / 2 - x_2 / 2 * (1 - 0.75 * c**2)]
            assert terms.f[i] == pytest.approx(f)
            assert terms.g[i] == pytest.approx(np.array([[0.0], [c]]))
            expected = np.array([[2 * x_1, 0.0], [x_2, x_1], [0.0, 2 * x_2]])
            assert terms.sigma_prime[i] == pytest.approx(expected)


def test_policies_are_the_games(functions: ValueFunctions) -> None:
    """û_1 and û_2 are (8) and (9) with V_ζ = σ'(ζ)'W, each with its own weights."""
    problem, rng = functions.problem, np.random.default_rng(13)
    for _ in range(10):
        zeta = rng.uniform(-1.0, 1.0, 12) * problem.scale
        actor_1, actor_2 = rng.standard_normal((2, functions.basis.n_basis))
        (sigma_prime,) = functions.sigma_prime(zeta)
        g = functions.at(zeta[None]).g[0]
        u_1, u_2 = functions.policies(zeta, actor_1, actor_2)
        expected_1 = problem.game.policies(g, sigma_prime.T @ actor_1)[0]
        expected_2 = problem.game.policies(g, sigma_prime.T @ actor_2)[1]
        assert u_1 == pytest.approx(expected_1, rel=1e-10)
        assert u_2 == pytest.approx(expected_2, rel=1e-10)


def test_results_are_copies(model: Model) -> None:
    """A later call does not change an earlier result, and the caller's array is not kept."""
    first, second = random_states(2)
    zeta = first.copy()
    f, g = model.drift(zeta), model.input_matrix(zeta)
    kept = f.copy(), g.copy()
    zeta[:] = second
    model.drift(second)
    model.input_matrix(second)
    assert np.array_equal(f, kept[0])
    assert np.array_equal(g, kept[1])
    assert np.array_equal(model.drift(first), kept[0])


def test_memory_order_does_not_matter() -> None:
    """A C-ordered, a Fortran-ordered and a strided argument mean the same matrix."""
    x = SX.sym("x", 3, 4)
    kernel = Kernel(casadi.Function("rows", [x], [casadi.densify(x @ DM([1, 2, 3, 4])), x.T]))
    matrix = np.arange(12.0).reshape(3, 4)
    for given in (matrix, np.asfortranarray(matrix), np.repeat(matrix, 2, axis=1)[:, ::2]):
        product, transposed = kernel(given)
        assert np.array_equal(product, matrix @ [1, 2, 3, 4])
        assert np.array_equal(transposed, matrix.T)


def test_wrong_number_of_arguments_is_an_error() -> None:
    """A kernel does not silently use the argument of the call before."""
    x, y = SX.sym("x"), SX.sym("y")
    kernel = Kernel(casadi.Function("sum", [x, y], [x + y]))
    with pytest.raises(ValueError, match="zip"):
        kernel([1.0])
