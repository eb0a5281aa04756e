"""Expressions as data: what is read is what was written, to the last bit, and nothing else is taken."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from typing import Any

import casadi
import numpy as np
import pytest
from casadi import SX
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from stationkeep.symbolic import (
    Basis,
    Game,
    InputError,
    Model,
    Problem,
    Vehicle,
    expressions,
    find_function,
)
from stationkeep.symbolic.compilation import c_source
from stationkeep.symbolic.expressions import OPERATIONS, from_data, to_data
from stationkeep.symbolic.kernel import dense_function
from stationkeep.symbolic.textbook import double_integrators, quadrotor, two_state_game

Array = NDArray[np.float64]
Path = tuple[str | int, ...]
VEHICLES = ("bluerov2-heavy", "bluerov2-heavy-buoyant", "rexrov")
BASES = ("quadratic", "drag", "drag-cubic")
OUTSIDE = {"acosh": 1.5}  # where the operand 0.3 is no argument


def rebuilt(function: casadi.Function) -> casadi.Function:
    """Return the function read from the JSON text of its data."""
    text = json.dumps(to_data(function), allow_nan=False)
    return from_data(json.loads(text))


def of_problem(problem: Problem) -> Iterator[casadi.Function]:
    """Yield f, g, the switching functions and the inverse dynamics, each by itself, and all in one."""
    zeta, parts = problem.zeta, {"f": problem.drift, "g": problem.input_matrix}
    inputs = {"zeta": zeta}
    if problem.switching.shape[1]:
        parts["switching"] = problem.switching
    if problem.inverse_dynamics is not None:
        inputs["acceleration"] = problem.inverse_dynamics.acceleration
        parts["v"] = problem.inverse_dynamics.v
    for name, expression in parts.items():
        yield casadi.Function(f"only_{name}", [*inputs.values()], [expression], [*inputs], [name])
    yield dense_function("all_of_it", inputs, parts)


def shipped_problem(vehicle: str) -> Problem:
    model = Model(Vehicle.load(vehicle), current=(0.2, -0.1, 0.05), compiled=False)
    return model.problem(Game(np.ones(12), np.ones(6), np.ones(6), 2.0), np.full(12, 0.5))


def require_equal(first: casadi.Function, second: casadi.Function) -> None:
    """Require the same code, and at random points the same bits of values and Jacobians."""
    assert c_source(first) == c_source(second)
    assert c_source(first.jacobian()) == c_source(second.jacobian())
    assert first.name_in() == second.name_in()
    assert first.name_out() == second.name_out()
    for i in range(first.n_out()):
        assert first.sparsity_out(i) == second.sparsity_out(i)
    rng = np.random.default_rng(5)
    for _ in range(5):
        point = [rng.uniform(-1.0, 1.0, first.size_in(i)) for i in range(first.n_in())]
        for a, b in zip(bits(first, point), bits(second, point), strict=True):
            assert a == b
        zeros = [np.zeros(first.size_out(i)) for i in range(first.n_out())]
        pair = first.jacobian(), second.jacobian()
        for a, b in zip(*(bits(each, [*point, *zeros]) for each in pair), strict=True):
            assert a == b


def bits(function: casadi.Function, point: list[Array]) -> list[bytes]:
    return [np.array(value.nonzeros()).tobytes() for value in function.call(point)]


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_vehicles_are_equal_to_the_last_bit(vehicle: str) -> None:
    for function in of_problem(shipped_problem(vehicle)):
        require_equal(function, rebuilt(function))


@pytest.mark.parametrize(
    "problem", [two_state_game(), quadrotor(), double_integrators(3, stiffness=1.0, damping=0.1)]
)
def test_textbook_problems_are_equal_to_the_last_bit(problem: Problem) -> None:
    for function in of_problem(problem):
        require_equal(function, rebuilt(function))


@pytest.mark.parametrize("name", BASES)
def test_bases_are_equal_to_the_last_bit(name: str) -> None:
    zeta = SX.sym("zeta", 12)
    basis = Basis.build(name, find_function(name), zeta, np.linspace(0.3, 2.0, 12))
    for expression in (basis.sigma, casadi.jacobian(basis.sigma, zeta)):
        function = casadi.Function("sigma", [zeta], [expression], ["zeta"], ["sigma"])
        require_equal(function, rebuilt(function))


def test_expressions_taken_out_and_put_in_again_give_the_same_code() -> None:
    """The hash of the code is a fingerprint: it must survive a problem that is built from data."""
    for function in of_problem(shipped_problem("bluerov2-heavy")):
        read = rebuilt(function)
        symbols = [SX.sym("fresh", *read.size_in(i)) for i in range(read.n_in())]
        again = casadi.Function(
            read.name(), symbols, read.call(symbols), read.name_in(), read.name_out()
        )
        assert c_source(again) == c_source(function)


@pytest.mark.parametrize("word", OPERATIONS)
def test_every_operation_is_written_by_its_name(word: str) -> None:
    """One node of each kind, whose numbers of CasADi never show."""
    x, y = SX.sym("x"), SX.sym("y")
    code = getattr(casadi, f"OP_{word.upper()}")
    exponent = SX(2.5) if word == "constpow" else y
    node = SX.unary(code, x) if OPERATIONS[word] == 1 else SX.binary(code, x, exponent)
    function = casadi.Function("one", [x, y], [node], ["x", "y"], ["out"])
    data = to_data(function)
    made = function.instruction_id(function.n_instructions() - 2) == code
    assert made or word == "twice"  # CasADi 3.7 knows 2 * x only
    assert data["instructions"][-1][0] == (word if made else "mul")
    assert to_data(rebuilt(function)) == data
    point = [OUTSIDE.get(word, 0.3), 0.7]
    value = float(function(*point))
    assert np.isfinite(value)
    assert float(rebuilt(function)(*point)).hex() == value.hex()
    assert c_source(rebuilt(function)) == c_source(function)


def test_no_operation_that_does_more_than_calculate_is_taken() -> None:
    """CasADi's expressions can print and call functions; data can't."""
    for code in (casadi.OP_PRINTME, casadi.OP_CALL, casadi.OP_PARAMETER, casadi.OP_LIFT):
        assert code not in [getattr(casadi, f"OP_{word.upper()}") for word in OPERATIONS]
    x = SX.sym("x")
    printing = casadi.Function("printing", [x], [SX.binary(casadi.OP_PRINTME, x, SX(1))])
    with pytest.raises(InputError, match="an operation that can't be written as data"):
        to_data(printing)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_whatever_is_built_is_read_as_it_was_written(data: st.DataObject) -> None:
    """Random graphs, also with nodes that CasADi would simplify: reading is a fixed point."""
    n = data.draw(st.integers(1, 12))
    written = small()
    instructions: list[list[Any]] = [["input", 0, 0], ["input", 0, 1], ["constant", (0.75).hex()]]
    for _ in range(n):
        word = data.draw(st.sampled_from(sorted(OPERATIONS)))
        earlier = st.integers(0, len(instructions) - 1)
        instructions.append([word, *(data.draw(earlier) for _ in range(OPERATIONS[word]))])
    written["instructions"] = instructions
    written["outputs"][0]["values"] = [len(instructions) - 1]
    once = from_data(written)
    try:
        twice = rebuilt(once)
    except InputError:  # CasADi works out what has constant operands, and that may be no number
        reject()
    assert to_data(twice) == to_data(once)
    assert c_source(twice) == c_source(once)
    for point in ([0.3, -0.6], [-2.0, 5.0], [0.0, 1.0]):
        assert bits(once, [np.array(point)]) == bits(twice, [np.array(point)])


def test_constants_keep_every_bit_and_may_be_infinite() -> None:
    x = SX.sym("x")
    numbers = [0.1, -1 / 3, 5e-324, 1.7976931348623157e308, np.pi, 2.0**60 + 2.0**10, np.inf, -np.inf]
    function = casadi.Function("f", [x], [casadi.vertcat(*(casadi.copysign(c, x) for c in numbers))])
    constants = [each[1] for each in to_data(function)["instructions"] if each[0] == "constant"]
    assert [float.fromhex(text) for text in constants] == numbers
    assert c_source(rebuilt(function)) == c_source(function)


def test_sparse_and_empty_arguments_keep_their_shape() -> None:
    A, nothing = SX.sym("A", casadi.Sparsity.lower(3)), SX.sym("nothing", 0, 1)
    outputs = [A @ A, SX(2, 4), SX(0, 1), SX.sym("unused", 0, 0)]
    function = casadi.Function("f", [A, nothing], outputs, ["A", "b"], ["a", "c", "d", "e"])
    read = rebuilt(function)
    assert [read.sparsity_in(i) for i in range(2)] == [function.sparsity_in(i) for i in range(2)]
    assert [read.sparsity_out(i) for i in range(4)] == [function.sparsity_out(i) for i in range(4)]
    require_equal(function, read)


def test_simplification_is_as_it_was_afterwards() -> None:
    x, broken = SX.sym("x"), small()
    broken["instructions"].append(["mul", 0, 99])
    from_data(small())
    with pytest.raises(InputError):
        from_data(broken)
    assert casadi.GlobalOptions.getSimplificationOnTheFly()
    assert (x + 0).is_symbolic()


def small() -> dict[str, Any]:
    """Return data of y = (x_0 * 1.5) + x_1, written by hand."""
    return {
        "format": 1,
        "name": "f",
        "inputs": [{"name": "x", "rows": 2, "columns": 1, "pattern": None}],
        "instructions": [
            ["input", 0, 0],
            ["constant", "0x1.8000000000000p+0"],
            ["mul", 0, 1],
            ["input", 0, 1],
            ["add", 2, 3],
        ],
        "outputs": [{"name": "y", "rows": 1, "columns": 1, "pattern": None, "values": [4]}],
    }


def sparse() -> dict[str, Any]:
    """Return data of the same with its result in the corner of a 2 by 3 matrix."""
    data = small()
    pattern = {"colind": [0, 0, 0, 1], "row": [1]}
    data["outputs"][0] |= {"rows": 2, "columns": 3, "pattern": pattern}
    return data


def changed(data: dict[str, Any], path: Path, value: Any) -> dict[str, Any]:
    """Return a copy of the data with the place at `path` replaced."""
    copied: Any = copy.deepcopy(data)
    place = copied
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return dict(copied)


def test_data_written_by_hand_is_read() -> None:
    assert float(from_data(small())([2.0, 0.25])) == 3.25
    result = from_data(sparse())([2.0, 0.25])
    assert result.shape == (2, 3)
    assert result.nnz() == 1
    assert float(result[1, 2]) == 3.25


CONSTANT: Path = ("instructions", 1, 1)
REFUSED: list[tuple[Path, Any, str]] = [
    (("format",), 2, "its format must be 1"),
    (("format",), True, "its format must be 1"),
    (("name",), "a b", "the name of the function must be a word"),
    (("name",), "x" * 300, "must be a word"),
    (("name",), "jac", "'jac' can't be the name of a function"),
    (("name",), 'f");system("', "must be a word"),
    (("inputs",), {}, "'inputs' must be an array"),
    (("inputs", 0), [], "input 0 must be a table of name, rows, columns, pattern"),
    (("inputs", 0, "name"), "é", "the name of input 0 must be a word"),
    (("inputs", 0, "name"), "y", "the same name"),
    (("inputs", 0, "rows"), -1, "'rows' of input 0 asks for -1 as a size"),
    (("inputs", 0, "rows"), 10**30, "'rows' of input 0 asks for something else as a size"),
    (("inputs", 0, "rows"), 1, "instruction 3 asks for 1 as an entry of it, but one below 1 is needed"),
    (("inputs", 0, "columns"), 500_001, "a function has 1000002 entries, but as data at most 1000000"),
    (("inputs", 0, "columns"), 2.0, "'columns' of input 0 asks for something else as a size"),
    (("inputs", 0, "more"), 1, "input 0 must be a table"),
    (("inputs", 0, "pattern"), 3, "the pattern of input 0 must be a table of colind, row"),
    (("instructions",), None, "'instructions' must be an array"),
    (("instructions", 2), "mul", "instruction 2 must be an array that starts with a word"),
    (("instructions", 2), [], "instruction 2 must be an array that starts with a word"),
    (("instructions", 2, 0), "system", "instruction 2 is 'system', which is no known operation"),
    (("instructions", 2, 0), 3, "must be an array that starts with a word"),
    (("instructions", 2, 0), "sin", "instruction 2, 'sin', has 2 operands, but needs 1"),
    (("instructions", 2, 1), 2, "instruction 2 asks for 2 as an earlier instruction, but one below 2"),
    (("instructions", 2, 1), -1, "asks for -1 as an earlier instruction"),
    (("instructions", 2, 1), False, "asks for something else as an earlier instruction"),
    (("instructions", 0, 1), 1, "instruction 0 asks for 1 as an input, but one below 1 is needed"),
    (CONSTANT, 1.5, "instruction 1 must hold a number as a hexadecimal float"),
    (CONSTANT, "nan", "instruction 1 must hold a number as a hexadecimal float"),
    (CONSTANT, "0x1p99999", "instruction 1 must hold a number as a hexadecimal float"),
    (CONSTANT, "1.5", "instruction 1 writes a number in another way than '0x1.5"),
    (CONSTANT, "-0x0.0p+0", "instruction 1 writes a number in another way than '0x0.0p+0'"),
    (("outputs", 0, "values"), [], "output 0 must have one value for each of its 1 nonzeros"),
    (("outputs", 0, "values"), [5], "output 0 asks for 5 as an instruction, but one below 5 is needed"),
    (("outputs", 0, "values"), 4, "output 0 must have one value for each of its 1 nonzeros"),
]
COLIND: Path = ("outputs", 0, "pattern", "colind")
REFUSED_PATTERNS: list[tuple[Path, Any, str]] = [
    (COLIND, [0, 0, 1], "'colind' of output 0 must go from 0 to the number of nonzeros in 3 steps"),
    (COLIND, [0, 0, 0, 2], "'colind' of output 0 must go from 0 to the number of nonzeros"),
    (COLIND, [0, 1, 0, 1], "'colind' of output 0 must not fall"),
    (COLIND, [0, 0, 0, 1.0], "must be two arrays of integers"),
    (("outputs", 0, "pattern", "row"), [2], "'row' of output 0 must rise from 0 to at most 1"),
    (("outputs", 0, "pattern", "row"), [-1], "'row' of output 0 must rise from 0 to at most 1"),
    (("outputs", 0, "pattern", "row"), "1", "must be two arrays of integers"),
]


@pytest.mark.parametrize(
    ("data", "path", "value", "needed"),
    [(small, *each) for each in REFUSED] + [(sparse, *each) for each in REFUSED_PATTERNS],
)
def test_what_is_not_of_the_form_is_refused_in_one_sentence(
    data: Callable[[], dict[str, Any]],
    path: Path,
    value: Any,
    needed: str,
    one_sentence: Callable[[BaseException], str],
) -> None:
    with pytest.raises(InputError) as caught:
        from_data(changed(data(), path, value))
    assert needed in one_sentence(caught.value)
    assert str(caught.value).endswith(("; write it again with to_data", "; divide it"))


@pytest.mark.parametrize(
    "data", [None, 3, "f", [], [small()], {}, {"format": 1}, small() | {"code": ""}]
)
def test_what_is_no_such_table_is_refused(
    data: object, one_sentence: Callable[[BaseException], str]
) -> None:
    with pytest.raises(InputError) as caught:
        from_data(data)
    assert "must be a table of format, name, inputs" in one_sentence(caught.value)


def test_too_much_is_refused_before_it_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    argument = {"name": "x", "rows": 1, "columns": 1, "pattern": None}
    with pytest.raises(InputError, match="10001 inputs, but as data at most 10000"):
        from_data(changed(small(), ("inputs",), [argument] * 10_001))
    with pytest.raises(InputError, match="1000001 instructions, but as data at most 1000000"):
        from_data(changed(small(), ("instructions",), [["input", 0, 0]] * 1_000_001))
    monkeypatch.setattr(expressions, "MAX_INSTRUCTIONS", 4)
    with pytest.raises(InputError, match="but as data at most 4 are taken"):
        to_data(casadi.Function("f", [x := SX.sym("x")], [casadi.sin(x) + x**3]))


def test_functions_that_are_no_expressions_are_refused(
    one_sentence: Callable[[BaseException], str],
) -> None:
    m, x, free = casadi.MX.sym("m"), SX.sym("x"), SX.sym("free")
    cases = {
        "is not made of SX expressions": casadi.Function("f", [m], [m]),
        "has free symbols": casadi.Function("f", [x], [x + free], {"allow_free": True}),
        "a constant that is not a number": casadi.Function("f", [x], [x + SX(np.nan)]),
    }
    for needed, function in cases.items():
        with pytest.raises(InputError) as caught:
            to_data(function)
        assert needed in one_sentence(caught.value)


numbers = st.integers(-3, 8) | st.sampled_from([10**7, -(10**7), 2**63, -(2**80), 1.5, float("inf")])
texts = st.text(max_size=8) | st.sampled_from(["0x1.8000000000000p+0", "nan", "-inf", "x", "y", "__a"])
leaves = st.none() | st.booleans() | numbers | texts | st.sampled_from(sorted(OPERATIONS))
anything = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4)
)


def places(data: Any, path: Path = ()) -> list[Path]:
    """Return the paths of everything that data holds."""
    items: list[tuple[str | int, Any]] = []
    if isinstance(data, dict):
        items = [*data.items()]
    elif isinstance(data, list):
        items = [*enumerate(data)]
    below = [deeper for key, value in items for deeper in places(value, (*path, key))]
    return ([path] if path else []) + below


@settings(max_examples=400, deadline=2000, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_damaged_data_is_a_function_or_an_input_error(data: st.DataObject) -> None:
    """Up to three places of good data hold something else."""
    damaged = data.draw(st.sampled_from([small(), sparse()]))
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(places(damaged)))
        damaged = changed(damaged, path, data.draw(leaves | anything))
    try:
        function = from_data(damaged)
        function.call([np.ones(function.size_in(i)) for i in range(function.n_in())])
        again = to_data(function)
        assert to_data(from_data(again)) == again
    except InputError as error:
        if "\n" in str(error) or len(str(error)) > 360:
            raise AssertionError("the message is no sentence") from error


@settings(max_examples=200, deadline=2000)
@given(anything)
def test_anything_else_is_an_input_error(data: object) -> None:
    with pytest.raises(InputError):
        from_data(data)
