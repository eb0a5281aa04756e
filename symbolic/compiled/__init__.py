"""Functions of CasADi as C: code generation, the cache of libraries, calls without copies."""

from .batch import BatchKernel
from .compilation import NATIVE_FLAGS, CompilationError, c_source, cache_folder, compile_source
from .kernel import WITHOUT_COMPILER, Export, Kernel, dense_function, export, say_once
from .processes import is_gone

__all__ = [
    "NATIVE_FLAGS",
    "WITHOUT_COMPILER",
    "BatchKernel",
    "CompilationError",
    "Export",
    "Kernel",
    "c_source",
    "cache_folder",
    "compile_source",
    "dense_function",
    "export",
    "is_gone",
    "say_once",
]
