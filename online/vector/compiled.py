"""The learner's vector code, compiled when it is first asked for."""

from __future__ import annotations

import ctypes
from functools import cache
from importlib import resources

from ...symbolic.compiled import (
    NATIVE_FLAGS,
    WITHOUT_COMPILER,
    CompilationError,
    compile_source,
    say_once,
)


@cache
def _library() -> ctypes.CDLL:
    """Return the compiled code; raises CompilationError."""
    source = resources.files(__package__).joinpath("vector_rows.c").read_text(encoding="utf-8")
    path = compile_source(source, NATIVE_FLAGS).path
    try:
        library = ctypes.CDLL(str(path))
        pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_longlong
        library.bellman.argtypes = [pointer] * 5
        library.flow.argtypes = [pointer] * 3 + [number] * 2 + [pointer] * 2
        library.normal.argtypes = [pointer] * 2
        library.inverse_lanczos.argtypes = [integer, pointer, integer, *[pointer] * 3]
        library.flow.restype = library.inverse_lanczos.restype = integer
    except (OSError, AttributeError):
        raise CompilationError("what the C compiler built can't be loaded") from None
    return library


def library() -> ctypes.CDLL | None:
    """Return the compiled code, or None where it can't be compiled, which is said once."""
    try:
        return _library()
    except CompilationError as error:
        say_once(f"{error}; {WITHOUT_COMPILER}")
        return None
