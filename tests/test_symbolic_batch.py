"""A function at many points: the same numbers as CasADi's own map, compiled and not."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from casadi import SX
from scipy.integrate import solve_ivp
from stationkeep.symbolic.compiled import BatchKernel, dense_function
from stationkeep.symbolic.compiled.compilation import find_compiler


@pytest.fixture(params=[True, False], ids=["compiled", "virtual machine"])
def compiled(request: pytest.FixtureRequest) -> bool:
    """Whether to compile."""
    return bool(request.param)


def test_rows_are_points(compiled: bool) -> None:
    x, y = SX.sym("x", 3), SX.sym("y", 2)
    outputs = {"outer": x @ y.T, "sum": casadi.sum1(x) * y}
    kernel = BatchKernel(dense_function("outer", {"x": x, "y": y}, outputs), compiled=compiled)
    rng = np.random.default_rng(0)
    for n_points in (0, 1, 7, 7, 3):
        xs, ys = rng.standard_normal((n_points, 3)), rng.standard_normal((n_points, 2))
        outer, total = kernel(xs, ys)
        expected = np.einsum("ni,nj->nji", xs, ys).reshape(n_points, 6)  # column-major
        np.testing.assert_allclose(outer, expected, rtol=1e-15)
        np.testing.assert_allclose(total, xs.sum(axis=1)[:, None] * ys, rtol=1e-14)


def test_a_rolled_step_integrates(compiled: bool) -> None:
    """Midpoint steps of a pendulum against scipy."""
    x, h = SX.sym("x", 2), SX.sym("h")

    def rate(z: SX) -> SX:
        return casadi.vertcat(z[1], -casadi.sin(z[0]))

    step = {"after": x + h * rate(x + h / 2 * rate(x))}
    kernel = BatchKernel(dense_function("step", {"x": x, "h": h}, step), compiled=compiled)
    path = kernel.roll(np.array([1.0, 0.0]), np.full((2000, 1), 1e-3))
    exact = solve_ivp(lambda t, z: [z[1], -np.sin(z[0])], (0, 2), [1.0, 0.0], rtol=1e-11, atol=1e-12)
    assert path.shape == (2001, 2)
    np.testing.assert_allclose(path[-1], exact.y[:, -1], atol=1e-6)


@pytest.mark.parametrize("name", ["step", "advance", "square"])
def test_a_name_of_the_c_library_is_not_taken_for_it(name: str) -> None:
    """Where a compiler exists the compiled loop agrees with the virtual machine and is in use."""
    x = SX.sym("x", 2)
    kernel = BatchKernel(dense_function(name, {"x": x}, {"y": x**2}))
    np.testing.assert_allclose(kernel(np.full((3, 2), 3.0))[0], np.full((3, 2), 9.0))
    assert (kernel._loop is None) != (find_compiler() is not None)


def test_wrong_shapes_are_refused(compiled: bool) -> None:
    x = SX.sym("x", 2)
    kernel = BatchKernel(dense_function("square", {"x": x}, {"y": x**2}), compiled=compiled)
    with pytest.raises(ValueError, match="shapes"):
        kernel(np.zeros((4, 3)))
