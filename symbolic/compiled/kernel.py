"""Calls without copies: a CasADi function bound once to numpy arrays that live as long as it.

CasADi reads and writes column-major nonzeros, so every argument and result is dense and its array is
a Fortran-ordered view of one flat buffer. Every thread has arrays of its own.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX
from numpy.typing import ArrayLike

from ..arrays import Array
from .compilation import CompilationError, compile_function

logger = logging.getLogger("stationkeep")
MOST_SHRINKS = 6  # of random arguments at which a stiff function overflows
TOLERANCE = 1e-12  # largest norm-relative difference of compiled to symbolic
WITHOUT_COMPILER = "using CasADi's virtual machine and numpy, 5 to 10 times slower"


class Kernel(threading.local):
    """One function behind fixed buffers, which are each thread's own.

    Write to `inputs`, call `evaluate()`, read `outputs`; or call the kernel with arrays, which copies
    them in and the results out. A thread that meets the kernel first is given buffers (`__init__` runs
    once more in it, as for every `threading.local`), so that threads never see each other's numbers.

    Parameters
    ----------
    function : that is evaluated; its results are dense
    constants : values of its last inputs, written once

    Attributes
    ----------
    inputs, outputs : arrays of the function's shapes; vectors are one-dimensional
    """

    def __init__(self, function: casadi.Function, constants: Sequence[Array] = ()) -> None:
        self.function = function
        buffer, self.evaluate = function.buffer()
        self.inputs = tuple(_array(function.size_in(i)) for i in range(function.n_in()))
        self.outputs = tuple(_array(function.size_out(i)) for i in range(function.n_out()))
        for i, array in enumerate(self.inputs):
            buffer.set_arg(i, array.ravel(order="K").data)  # type: ignore[call-arg]
        for i, array in enumerate(self.outputs):
            buffer.set_res(i, array.ravel(order="K").data)  # type: ignore[call-arg]
        self._buffer = buffer
        for array, value in zip(reversed(self.inputs), reversed(constants), strict=False):
            array[...] = value

    def __call__(self, *arguments: ArrayLike) -> tuple[Array, ...]:
        """Return copies of all results for the given arguments."""
        for array, value in zip(self.inputs, arguments, strict=True):
            array[...] = value
        self.evaluate()
        return tuple([output.copy("K") for output in self.outputs])


def _array(size: tuple[int, int]) -> Array:
    rows, columns = size
    flat = np.zeros(rows * columns)
    return flat if columns == 1 else flat.reshape((rows, columns), order="F")


@dataclass(frozen=True)
class Export:
    """What became of one exported function: the row that `generate` prints.

    `max_difference` is the largest norm-relative difference of the compiled function to its symbolic
    source over random arguments; it is 0 for the virtual machine, which is the symbolic source.
    """

    name: str
    inputs: list[str]
    outputs: list[str]
    operations: int
    compiled: bool
    cache_hit: bool
    max_difference: float
    key: str | None


def export(
    function: casadi.Function,
    *,
    compiled: bool = True,
    operations: int | None = None,
    constants: Sequence[Array] = (),
) -> tuple[Kernel, Export]:
    """Compile a function, compare it with its symbolic source and bind it to buffers.

    The last inputs hold `constants` from then on.
    A mapped function, which can't count its `operations`, is told them, and compared for one set of
    arguments (its many points); others are counted and compared for 20.
    Without a usable compiler or cache the virtual machine takes its place, and a message says so once.
    """
    kernel, difference, key, hit = Kernel(function), 0.0, None, False
    mapped = operations is not None
    if compiled:
        try:
            library = compile_function(function)
            try:
                external = Kernel(casadi.external(function.name(), str(library.path)))
            except RuntimeError:
                raise CompilationError("what the C compiler built can't be loaded") from None
            difference = max_difference(kernel, external, n_points=1 if mapped else 20)
            if difference > TOLERANCE:
                raise CompilationError(
                    f"compiled '{function.name()}' differs from its source by {difference:.1e}"
                )
            kernel, key, hit = external, library.key, library.cache_hit
        except CompilationError as error:
            difference = 0.0
            say_once(f"{error}; {WITHOUT_COMPILER}")
    described = Export(
        name=function.name(),
        inputs=[_describe(function.name_in(i), function.size_in(i)) for i in range(function.n_in())],
        outputs=[
            _describe(function.name_out(i), function.size_out(i)) for i in range(function.n_out())
        ],
        operations=function.n_instructions() if operations is None else operations,
        compiled=key is not None,
        cache_hit=hit,
        max_difference=difference,
        key=key,
    )
    return Kernel(kernel.function, constants) if constants else kernel, described


def max_difference(first: Kernel, second: Kernel, n_points: int = 20, seed: int = 0) -> float:
    """Return the largest norm-relative difference of all outputs over seeded random arguments.

    Arguments are uniform on (-1, 1), which keeps a pitch inside ±90 degrees, or a tenth of that as
    often as it takes until the results of the first are finite; the inputs of both are zero afterwards.
    """
    rng = np.random.default_rng(seed)
    worst = 0.0
    for _ in range(n_points):
        arguments = [rng.uniform(-1.0, 1.0, array.shape) for array in first.inputs]
        results = first(*arguments)
        for _ in range(MOST_SHRINKS):
            if all(np.isfinite(result).all() for result in results):
                break
            arguments = [0.1 * argument for argument in arguments]
            results = first(*arguments)
        for a, b in zip(results, second(*arguments), strict=True):
            scale = float(np.linalg.norm(a))
            difference = float(np.linalg.norm(a - b))
            if not np.isfinite(difference):
                return float("inf")
            worst = max(worst, difference / scale if scale > 0.0 else difference)
    for array in (*first.inputs, *second.inputs):
        array[...] = 0.0
    return worst


def dense_function(name: str, inputs: dict[str, SX], outputs: dict[str, SX]) -> casadi.Function:
    """Return a function with named dense arguments and results, as buffers need them."""
    results = [casadi.densify(expression) for expression in outputs.values()]
    return casadi.Function(name, [*inputs.values()], results, [*inputs], [*outputs])


_said: set[str] = set()


def say_once(message: str) -> None:
    """Log a warning the first time it is given."""
    if message not in _said:
        _said.add(message)
        logger.warning(message)


def _describe(name: str, size: tuple[int, int]) -> str:
    rows, columns = size
    return f"{name}[{rows}]" if columns == 1 else f"{name}[{rows}x{columns}]"
