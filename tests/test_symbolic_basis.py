"""Bases of the value function: what they hold, their derivatives, and which ones are refused."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement
from pathlib import Path

import casadi
import numpy as np
import pytest
from casadi import SX
from numpy.typing import NDArray
from stationkeep.symbolic import (
    Basis,
    InputError,
    Problem,
    drag,
    drag_cubic,
    find_function,
    quadratic,
    two_state_game,
)

Array = NDArray[np.float64]
SIZES = {"quadratic": 78, "drag": 144, "drag-cubic": 270}


@pytest.fixture(params=[*SIZES])
def basis(request: pytest.FixtureRequest, reference_scale: Array) -> Basis:
    """Each shipped basis over the shipped envelope."""
    zeta = SX.sym("zeta", 12)
    return Basis.build(request.param, find_function(request.param), zeta, reference_scale)


def values(basis: Basis) -> Callable[[Array], Array]:
    """Return σ as a function of numbers."""
    function = casadi.Function("sigma", [basis.zeta], [basis.sigma])
    return lambda zeta: np.array(function(zeta)).ravel()


def expected_functions(name: str, x: Array) -> Array:
    """Return the functions of the scaled state in numpy, written from their published list."""
    sigma = [x[i] * x[j] for i in range(12) for j in range(i, 12)]
    if name == "quadratic":
        return np.array(sigma)
    for axis in range(6):
        a, b = x[axis], x[axis + 6]
        s_b = (1.0 + b * b / 0.09) ** -0.5
        g_a = np.hypot(1.0, a / 0.3)
        sigma += [a * a * g_a, a * a / g_a, a * b * s_b, a * b * g_a, a * b / g_a, b * b * s_b]
        sigma += [b * b * s_b * s_b, a * a * s_b, a * b * s_b * g_a, b * b * s_b * g_a, b * b * g_a]
    if name == "drag-cubic":
        pairs = combinations_with_replacement([0, 1, 2, 6, 7, 8], 2)
        sigma += [x[i] * x[j] * x[k] for i, j in pairs for k in (3, 4, 5, 9, 10, 11)]
    return np.array(sigma)


def test_sizes(basis: Basis) -> None:
    """78 = 12*13/2 monomials; 144 = 78 + 11*6; 270 = 144 + 21*6."""
    assert basis.n_basis == SIZES[basis.name]
    assert basis.n == 12
    assert basis.jacobian.shape == (SIZES[basis.name], 12)


def test_formulae(basis: Basis, reference_scale: Array) -> None:
    """Every function has its published formula in x = ζ / scale."""
    sigma = values(basis)
    for zeta in np.random.default_rng(0).uniform(-2.0, 2.0, (100, 12)) * reference_scale:
        expected = expected_functions(basis.name, zeta / reference_scale)
        assert sigma(zeta) == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_zero_at_the_origin(basis: Basis) -> None:
    """σ(0) = 0 and σ'(0) = 0: V_hat(0) = 0 and no force at the station."""
    at_origin = casadi.Function("f", [basis.zeta], [basis.sigma, basis.jacobian])(np.zeros(12))
    assert all(not np.array(value).any() for value in at_origin)


def test_jacobian(basis: Basis, reference_scale: Array) -> None:
    """σ' against fourth-order central differences."""
    sigma = values(basis)
    jacobian = casadi.Function("J", [basis.zeta], [basis.jacobian])
    steps = 1e-3 * np.diag(reference_scale)
    for zeta in np.random.default_rng(1).uniform(-1.0, 1.0, (20, 12)) * reference_scale:
        columns = [
            (8.0 * (sigma(zeta + d) - sigma(zeta - d)) - sigma(zeta + 2 * d) + sigma(zeta - 2 * d))
            / 12.0
            for d in steps
        ]
        scaled = np.array(jacobian(zeta)) * reference_scale * 1e-3
        assert np.linalg.norm(np.column_stack(columns) - scaled) < 1e-8 * np.linalg.norm(scaled)


def test_quadratic_weights(basis: Basis, reference_scale: Array) -> None:
    """W'σ(ζ) = ζ'P ζ for a full P, inside the envelope and far outside."""
    factor = np.random.default_rng(2).standard_normal((12, 12))
    P = factor @ factor.T
    weights = basis.quadratic_weights(P)
    assert weights.shape == (basis.n_basis,)
    sigma = values(basis)
    for zeta in np.random.default_rng(3).uniform(-3.0, 3.0, (50, 12)) * reference_scale:
        assert weights @ sigma(zeta) == pytest.approx(zeta @ P @ zeta, rel=1e-8)


def test_quadratic_weights_of_the_closed_form() -> None:
    """In the physical state the ideal weights on (ζ1^2, ζ1 ζ2, ζ2^2) are (1/2, 0, 1)."""
    problem = two_state_game()
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.ones(2))
    assert basis.quadratic_weights(problem.P) == pytest.approx([0.5, 0.0, 1.0], abs=1e-10)


def test_quadratic_basis_of_any_dimension() -> None:
    """n(n+1)/2 monomials, the first of each row its square."""
    x = SX.sym("x", 3)
    function = casadi.Function("sigma", [x], [quadratic(x)])
    assert np.array(function([2, 3, 5])).ravel().tolist() == [4, 6, 10, 9, 15, 25]


USER_FILE = """
import casadi


def squares(x):
    return casadi.vertcat(*[x[i] ** 2 for i in range(x.shape[0])], x[0] ** 3)


def with_constant(x):
    return casadi.vertcat(x[0] ** 2, x[1] ** 2 + 0.5)


def with_linear_term(x):
    return casadi.vertcat(x[0] ** 2, x[1] ** 2 - 3 * x[0])


def undefined_at_the_origin(x):
    return casadi.vertcat(x[0] ** 2, x[1] ** 3 / x[0])


def two_columns(x):
    return casadi.horzcat(x ** 2, x ** 3)


def numbers(x):
    return [1.0, 2.0]


def raises(x):
    return x[99] ** 2


not_a_function = 3
"""


@pytest.fixture
def user_file(tmp_path: Path) -> Path:
    """A user's Python file."""
    path = tmp_path / "my_basis.py"
    path.write_text(USER_FILE, encoding="utf-8")
    return path


def test_basis_of_a_user(user_file: Path, reference_problem: Problem) -> None:
    """'path.py:name' finds the function; it sees the scaled state."""
    function = find_function(f"{user_file}:squares")
    problem = reference_problem
    basis = Basis.build("mine", function, problem.zeta, problem.scale)
    assert basis.n_basis == 13
    zeta = np.arange(1.0, 13.0)
    x = zeta / problem.scale
    assert values(basis)(zeta) == pytest.approx([*x**2, x[0] ** 3])


@pytest.mark.parametrize(
    ("function", "words"),
    [
        ("with_constant", ["sigma(0) must be 0", "0.5", "second order"]),
        ("with_linear_term", ["sigma'(0) must be 0", "second order"]),
        ("undefined_at_the_origin", ["must be 0", "nan"]),
        ("two_columns", ["one column of casadi.SX"]),
        ("numbers", ["one column of casadi.SX"]),
        ("raises", ["raises"]),
        ("not_a_function", ["no function 'not_a_function'"]),
        ("square", ["no function 'square'"]),
    ],
)
def test_unusable_basis_is_refused(
    function: str,
    words: list[str],
    user_file: Path,
    reference_problem: Problem,
    one_sentence: Callable[[BaseException], str],
) -> None:
    """A constant or linear term, no value at the origin, a wrong shape, or no function at all."""
    with pytest.raises(InputError) as caught:
        Basis.build(
            function,
            find_function(f"{user_file}:{function}"),
            reference_problem.zeta,
            reference_problem.scale,
        )
    text = one_sentence(caught.value)
    assert all(word in text for word in words), text


@pytest.mark.parametrize(
    ("content", "word"),
    [
        ("def f(x:\n", "SyntaxError"),
        ("import there_is_no_such_module\n", "there_is_no_such_module"),
        ("import casadi\ncasadi.SX.sym('x')[9]\n", "RuntimeError"),
    ],
)
def test_broken_file_is_refused(
    content: str, word: str, tmp_path: Path, one_sentence: Callable[[BaseException], str]
) -> None:
    """A file that does not load is an input error that says why, in one line."""
    path = tmp_path / "broken.py"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match="can't be loaded") as caught:
        find_function(f"{path}:f")
    assert word in one_sentence(caught.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("drag-cubik", ["did you mean 'drag-cubic'?"]),
        ("zzz", ["drag, drag-cubic, quadratic"]),
        ("nowhere/basis.py:f", ["no Python file 'nowhere/basis.py'"]),
        ("basis.py", ["file.py:function"]),
    ],
)
def test_unknown_basis(
    name: str, words: list[str], one_sentence: Callable[[BaseException], str]
) -> None:
    """The nearest shipped basis is named, and how to give one's own."""
    with pytest.raises(InputError) as caught:
        find_function(name)
    text = one_sentence(caught.value)
    assert all(word in text for word in words), text


def test_drag_bases_need_positions_and_rates() -> None:
    """They pair each position with its rate: 32 functions for two axes, none for an odd number."""
    assert drag(casadi.SX.sym("x", 4)).shape == (10 + 22, 1)
    with pytest.raises(InputError, match="positions and their rates"):
        drag(casadi.SX.sym("x", 3))
    with pytest.raises(InputError, match="translations, angles and their rates"):
        drag_cubic(casadi.SX.sym("x", 6))


def test_weights_that_do_not_exist(user_file: Path, reference_problem: Problem) -> None:
    """Without the cross terms ζ'P ζ can't be represented; the message says what to include."""
    function = find_function(f"{user_file}:squares")
    basis = Basis.build("mine", function, reference_problem.zeta, reference_problem.scale)
    with pytest.raises(InputError, match="include the quadratic monomials"):
        basis.quadratic_weights(reference_problem.P)
