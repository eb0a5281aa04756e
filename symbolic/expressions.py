"""CasADi expressions as data: a function written as names and numbers, and built again from them.

What CasADi itself writes of a function is read back by executing it. Here a function is a table of
plain numbers and words that JSON can hold, and reading it never deserialises or executes anything:

    {"format": 1, "name": "f",
     "inputs": [{"name": "x", "rows": 2, "columns": 1, "pattern": null}],
     "instructions": [["input", 0, 0], ["constant", "0x1.8000000000000p+0"], ["mul", 1, 0]],
     "outputs": [{"name": "y", "rows": 1, "columns": 1, "pattern": null, "values": [2]}]}

The instruction with number i yields the value i: `input` the nonzero (argument, index), `constant` a
hexadecimal float, every other one an operation of `OPERATIONS` on values with lesser numbers. `pattern`
is null for a dense matrix, else the compressed columns {"colind", "row"} of its nonzeros; nonzeros are
counted down the columns. Operations have names of their own, so that CasADi may number its as it likes.

The graph that is built is the one that was written, node by node, because CasADi's simplifications are
off meanwhile. So values, derivatives and the generated C code are equal to the last bit. (They are off
for every thread of the process: expressions that another thread builds then are right, but longer.)
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import casadi
from casadi import SX

from .errors import InputError

FORMAT = 1
MAX_INSTRUCTIONS = 1_000_000
MAX_ARGUMENTS = 10_000  # inputs, and outputs
MAX_ENTRIES = 1_000_000  # of all inputs together, and of all outputs; zeros count

_WORDS = {
    1: (
        "neg exp log sqrt sq twice inv sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh "
        "not floor ceil fabs sign erf erfinv log1p expm1"
    ),
    2: (
        "add sub mul div pow constpow lt le eq ne and or fmod remainder copysign if_else_zero "
        "fmin fmax atan2 hypot"
    ),
}
OPERATIONS: Mapping[str, int] = MappingProxyType(
    {word: arity for arity, words in _WORDS.items() for word in words.split()}
)
"""How many values each operation takes."""

_CODES: dict[str, int] = {name: getattr(casadi, f"OP_{name.upper()}") for name in OPERATIONS}
_NAMES = {code: name for name, code in _CODES.items()}
# CasADi makes these nodes where it simplifies, and 1 / x, 2 * x and pow(x, n) where it doesn't
_SIMPLIFIED = frozenset(("inv", "twice", "constpow"))
_INPUT_KEYS = ("name", "rows", "columns", "pattern")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,199}", re.ASCII)


def to_data(function: casadi.Function) -> dict[str, Any]:
    """Return a function of SX expressions as data that JSON can hold.

    Raises
    ------
    InputError
        If it is no function of SX expressions, has free symbols, an operation that is not in
        `OPERATIONS`, a constant that is not a number, or more than `from_data` takes.
    """
    name = function.name()
    if not function.is_a("SXFunction"):
        raise InputError(f"function '{name}' is not made of SX expressions; call its expand() first")
    if function.has_free():
        raise InputError(f"function '{name}' has free symbols; make them inputs")
    instructions, results = _instructions(function)
    data = {
        "format": FORMAT,
        "name": name,
        "inputs": [
            _argument(function.name_in(i), function.sparsity_in(i)) for i in range(function.n_in())
        ],
        "instructions": instructions,
        "outputs": [
            _argument(function.name_out(i), function.sparsity_out(i)) | {"values": values}
            for i, values in enumerate(results)
        ],
    }
    _check_head(data)
    return data


def from_data(data: object) -> casadi.Function:
    """Return the function of SX expressions that `to_data` wrote.

    Raises
    ------
    InputError
        If the data is not exactly of that form or too large; one sentence says where.
    """
    checked = _check_head(data)
    inputs = [_sparsity(each, f"input {i}") for i, each in enumerate(checked["inputs"])]
    outputs = [_sparsity(each, f"output {i}") for i, each in enumerate(checked["outputs"])]
    names = [each["name"] for each in checked["inputs"]]
    symbols = [SX.sym(name, pattern) for name, pattern in zip(names, inputs, strict=True)]
    values: list[SX] = []
    with _simplification(False):
        for number, instruction in enumerate(checked["instructions"]):
            values.append(_value(number, instruction, symbols, values))
    results = [
        _result(pattern, each["values"], values, f"output {i}")
        for i, (pattern, each) in enumerate(zip(outputs, checked["outputs"], strict=True))
    ]
    names_out = [each["name"] for each in checked["outputs"]]
    return casadi.Function(checked["name"], symbols, results, names, names_out)


def _instructions(function: casadi.Function) -> tuple[list[list[Any]], list[list[int]]]:
    """Return the instructions, and for each output the numbers of its nonzeros' values."""
    _at_most(function.n_instructions(), MAX_INSTRUCTIONS, "instructions")
    held: dict[int, int] = {}  # which value a place of CasADi's work vector holds
    instructions: list[list[Any]] = []
    results = [[0] * function.nnz_out(i) for i in range(function.n_out())]
    for i in range(function.n_instructions()):
        code, taken = function.instruction_id(i), function.instruction_input(i)
        if code == casadi.OP_OUTPUT:
            output, nonzero = function.instruction_output(i)
            results[output][nonzero] = held[taken[0]]
            continue
        if code == casadi.OP_INPUT:
            instruction = ["input", *taken]
        elif code == casadi.OP_CONST:
            instruction = ["constant", _hexadecimal(function.instruction_constant(i))]
        elif code in _NAMES:
            word = _NAMES[code]
            instruction = [word, *(held[place] for place in taken[: OPERATIONS[word]])]
        else:
            raise InputError(
                f"function '{function.name()}' has an operation that can't be written as data "
                f"(CasADi's number {code}); write it with elementary functions"
            )
        held[function.instruction_output(i)[0]] = len(instructions)
        instructions.append(instruction)
    return instructions, results


def _argument(name: str, sparsity: casadi.Sparsity) -> dict[str, Any]:
    rows, columns = sparsity.shape
    pattern = None
    if not sparsity.is_dense():
        pattern = {"colind": list(sparsity.colind()), "row": list(sparsity.row())}
    return {"name": name, "rows": rows, "columns": columns, "pattern": pattern}


def _hexadecimal(value: float) -> str:
    if value != value:
        raise InputError("the function has a constant that is not a number; remove it")
    return float(value).hex()


@contextmanager
def _simplification(on: bool) -> Iterator[None]:
    """Switch CasADi's simplification of new expressions meanwhile."""
    before = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(on)
    try:
        yield
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(before)


def _value(number: int, instruction: Any, symbols: list[SX], values: list[SX]) -> SX:
    """Return the value of an instruction, once it is known to be one."""
    where = f"instruction {number}"
    if type(instruction) is not list or not instruction or type(instruction[0]) is not str:
        raise _fault(f"{where} must be an array that starts with a word")
    word, given = instruction[0], instruction[1:]
    arity = {"input": 2, "constant": 1}.get(word, OPERATIONS.get(word))
    if arity is None:
        raise _fault(f"{where} is {word[:30]!r}, which is no known operation")
    if len(given) != arity:
        raise _fault(f"{where}, '{word}', has {len(given)} operands, but needs {arity}")
    if word == "constant":
        return _constant(given[0], where)
    if word == "input":
        symbol = symbols[_index(given[0], len(symbols), where, "an input")]
        return symbol.nz[_index(given[1], symbol.nnz(), where, "an entry of it")]
    operands = [values[_index(each, number, where, "an earlier instruction")] for each in given]
    make = SX.unary if arity == 1 else SX.binary
    if word not in _SIMPLIFIED:
        return make(_CODES[word], *operands)
    with _simplification(True):
        return make(_CODES[word], *operands)


def _constant(text: Any, where: str) -> SX:
    """Return a constant; only the one way to write it is taken, so that reading loses nothing."""
    try:
        value = float.fromhex(text) if type(text) is str and len(text) < 40 else None
    except (ValueError, OverflowError):
        value = None
    if value is None or value != value:
        raise _fault(f"{where} must hold a number as a hexadecimal float such as '0x1.0p+0'")
    constant = SX(value)
    if float(constant).hex() != text:
        raise _fault(f"{where} writes a number in another way than '{float(constant).hex()}'")
    return constant


def _result(pattern: casadi.Sparsity, given: Any, values: list[SX], where: str) -> SX:
    nonzeros = pattern.nnz()
    if type(given) is not list or len(given) != nonzeros:
        raise _fault(f"{where} must have one value for each of its {nonzeros} nonzeros")
    taken = [values[_index(each, len(values), where, "an instruction")] for each in given]
    return SX(pattern, casadi.vertcat(*taken)) if taken else SX(pattern)


def _check_head(data: Any) -> dict[str, Any]:
    """Return the data whose names, shapes and lengths have been checked; its patterns not yet."""
    _keys(data, ("format", "name", "inputs", "instructions", "outputs"), "the data")
    if type(data["format"]) is not int or data["format"] != FORMAT:
        raise _fault(f"its format must be {FORMAT}")
    _word(data["name"], "the name of the function")
    if not casadi.Function.check_name(data["name"]):
        raise _fault(f"'{data['name']}' can't be the name of a function")
    limits = {"inputs": MAX_ARGUMENTS, "outputs": MAX_ARGUMENTS, "instructions": MAX_INSTRUCTIONS}
    for key, limit in limits.items():
        if type(data[key]) is not list:
            raise _fault(f"'{key}' must be an array")
        _at_most(len(data[key]), limit, key)
    for key, keys in (("inputs", _INPUT_KEYS), ("outputs", (*_INPUT_KEYS, "values"))):
        for i, argument in enumerate(data[key]):
            _keys(argument, keys, f"{key[:-1]} {i}")
            _word(argument["name"], f"the name of {key[:-1]} {i}")
            for size in ("rows", "columns"):
                _index(argument[size], MAX_ENTRIES + 1, f"'{size}' of {key[:-1]} {i}", "a size")
        _at_most(sum(each["rows"] * each["columns"] for each in data[key]), MAX_ENTRIES, "entries")
    names = [argument["name"] for key in ("inputs", "outputs") for argument in data[key]]
    if len(set(names)) < len(names):
        raise _fault("two of its inputs and outputs have the same name")
    return dict(data)


def _sparsity(argument: dict[str, Any], where: str) -> casadi.Sparsity:
    rows, columns, pattern = argument["rows"], argument["columns"], argument["pattern"]
    if pattern is None:
        return casadi.Sparsity.dense(rows, columns)
    _keys(pattern, ("colind", "row"), f"the pattern of {where}")
    colind, row = pattern["colind"], pattern["row"]
    if not all(type(each) is list and all(type(i) is int for i in each) for each in (colind, row)):
        raise _fault(f"the pattern of {where} must be two arrays of integers")
    if len(colind) != columns + 1 or colind[0] != 0 or colind[-1] != len(row):
        raise _fault(f"'colind' of {where} must go from 0 to the number of nonzeros in {columns} steps")
    if any(a > b for a, b in pairwise(colind)):
        raise _fault(f"'colind' of {where} must not fall")
    for start, end in pairwise(colind):
        column = row[start:end]
        ascending = all(a < b for a, b in pairwise(column))
        if column and not (column[0] >= 0 and column[-1] < rows and ascending):
            raise _fault(f"'row' of {where} must rise from 0 to at most {rows - 1} in each column")
    return casadi.Sparsity(rows, columns, colind, row)


def _keys(table: Any, keys: tuple[str, ...], what: str) -> None:
    if type(table) is not dict or set(table) != set(keys):
        raise _fault(f"{what} must be a table of {', '.join(keys)}")


def _word(name: Any, what: str) -> None:
    if type(name) is not str or not _NAME.fullmatch(name):
        raise _fault(f"{what} must be a word of letters, digits and underscores")


def _index(given: Any, size: int, where: str, what: str) -> int:
    """Return a number that must be an integer from 0 to size - 1."""
    if type(given) is not int or not 0 <= given < size:
        asked = "something else" if type(given) is not int or abs(given) > 1e9 else str(given)
        below = f"one below {size}" if size else "there is none"
        raise _fault(f"{where} asks for {asked} as {what}, but {below} is needed")
    return given


def _at_most(number: int, limit: int, what: str) -> None:
    if number > limit:
        raise InputError(
            f"a function has {number} {what}, but as data at most {limit} are taken; divide it"
        )


def _fault(text: str) -> InputError:
    return InputError(f"a function can't be read from data: {text}; write it again with to_data")
