"""One function at any number of points: a compiled loop over contiguous rows.

CasADi's own `map` fixes the number of points when it is compiled. Here a few lines of C loop over the
points around the generated function, so that one library serves every mesh and every sample set.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import casadi
import numpy as np

from ..arrays import Array
from .compilation import FLAGS, CompilationError, c_source, compile_source
from .kernel import TOLERANCE, WITHOUT_COMPILER, Kernel, say_once

_LOOP = """
int batch(long long n, const double* const* in, double* const* out) {{
  const double* arg[{arg}]; double* res[{res}]; long long iw[{iw}]; double w[{w}];
  static const long long rows_in[] = {{{rows_in}}}, rows_out[] = {{{rows_out}}};
  long long p, i;
  for (p = 0; p < n; ++p) {{
    for (i = 0; i < {n_in}; ++i) arg[i] = in[i] + p * rows_in[i];
    for (i = 0; i < {n_out}; ++i) res[i] = out[i] + p * rows_out[i];
    if ({name}(arg, res, iw, w, 0)) return 1;
  }}
  return 0;
}}
"""


class BatchKernel:
    """A dense CasADi function evaluated at the rows of its arguments.

    Compiled where a C compiler exists; otherwise CasADi's virtual machine, point by point. What was
    compiled is compared with the virtual machine on random arguments before it is used.
    """

    def __init__(self, function: casadi.Function, *, compiled: bool = True) -> None:
        self.function = function
        self._single = Kernel(function)
        self._rows_in = [function.numel_in(i) for i in range(function.n_in())]
        self._rows_out = [function.numel_out(i) for i in range(function.n_out())]
        self._loop = self._compile() if compiled else None

    def __call__(self, *arguments: Array) -> tuple[Array, ...]:
        """Return the results at N points, each (N, entries), a matrix in column-major order.

        Arguments are (N, entries), likewise.
        """
        columns = [np.ascontiguousarray(argument, dtype=np.float64) for argument in arguments]
        n_points = len(columns[0])
        results = [np.empty((n_points, rows)) for rows in self._rows_out]
        self._evaluate(n_points, columns, results)
        return tuple(results)

    def roll(self, start: Array, *arguments: Array) -> Array:
        """Return x_0 = `start` and x_{i+1} = function(x_i, rows i of `arguments`), (N + 1, entries).

        For a function with one result that takes the place of its first argument.
        """
        columns = [np.ascontiguousarray(argument, dtype=np.float64) for argument in arguments]
        n_steps = len(columns[0])
        path = np.empty((n_steps + 1, len(start)))
        path[0] = start
        # every step reads the row that the step before it wrote
        self._evaluate(n_steps, [path[:-1], *columns], [path[1:]])
        return path

    def _evaluate(self, n_points: int, columns: Sequence[Array], results: Sequence[Array]) -> None:
        shapes = [column.shape for column in columns]
        if shapes != [(n_points, rows) for rows in self._rows_in]:
            raise ValueError(f"arguments of {self.function.name()} have shapes {shapes}")
        if self._loop is None:
            self._one_by_one(n_points, columns, results)
        elif self._loop(n_points, _pointers(columns), _pointers(results)):
            raise RuntimeError(f"{self.function.name()} could not be evaluated")

    def _one_by_one(self, n_points: int, columns: Sequence[Array], results: Sequence[Array]) -> None:
        kernel = self._single
        for point in range(n_points):
            for array, column in zip(kernel.inputs, columns, strict=True):
                array.ravel(order="K")[...] = column[point]
            kernel.evaluate()
            for result, array in zip(results, kernel.outputs, strict=True):
                result[point] = array.ravel(order="K")

    def _compile(self) -> ctypes._NamedFuncPointer | None:
        try:
            # a name of its own: the C library has functions called `step` or `advance`, which the call
            # inside `batch` would be bound to
            renamed = f"#define {self.function.name()} stationkeep_{self.function.name()}\n"
            library = compile_source(renamed + c_source(self.function) + self._wrapper(), FLAGS)
            try:
                loop = ctypes.CDLL(str(library.path)).batch
            except (OSError, AttributeError):
                raise CompilationError("what the C compiler built can't be loaded") from None
            loop.argtypes = [ctypes.c_longlong, ctypes.c_void_p, ctypes.c_void_p]
            difference = self._difference(loop)
            if not difference <= TOLERANCE:
                raise CompilationError(
                    f"compiled '{self.function.name()}' differs from its source by {difference:.1e}"
                )
            return loop
        except CompilationError as error:
            say_once(f"{error}; {WITHOUT_COMPILER}")
            return None

    def _difference(self, loop: ctypes._NamedFuncPointer, n_points: int = 10) -> float:
        """Return the largest norm-relative difference to the virtual machine at seeded points."""
        rng = np.random.default_rng(0)
        columns = [rng.uniform(-1.0, 1.0, (n_points, rows)) for rows in self._rows_in]
        fast, slow = ([np.empty((n_points, rows)) for rows in self._rows_out] for _ in range(2))
        loop(n_points, _pointers(columns), _pointers(fast))
        self._one_by_one(n_points, columns, slow)
        return max(
            float(np.linalg.norm(a - b) / max(np.linalg.norm(b), np.finfo(float).tiny))
            for a, b in zip(fast, slow, strict=True)
        )

    def _wrapper(self) -> str:
        function = self.function
        return _LOOP.format(
            name=function.name(),
            arg=function.sz_arg() + 1,
            res=function.sz_res() + 1,
            iw=function.sz_iw() + 1,
            w=function.sz_w() + 1,
            n_in=function.n_in(),
            n_out=function.n_out(),
            rows_in=", ".join(map(str, self._rows_in)),
            rows_out=", ".join(map(str, self._rows_out)),
        )


def _pointers(arrays: Sequence[Array]) -> ctypes.Array[ctypes.c_void_p]:
    return (ctypes.c_void_p * len(arrays))(*(array.ctypes.data for array in arrays))
