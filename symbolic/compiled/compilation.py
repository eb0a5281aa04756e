"""C code of a CasADi function, compiled into a content-addressed cache.

The key is the SHA-256 of the C text (which is the whole graph), the compiler and its version, the
flags, the machine (with -march=native, all that the compiler says of this processor) and the CasADi
version. An entry is a folder that holds the source, the shared library and a manifest with the
library's own SHA-256. It is built under a temporary name and renamed, so that concurrent builds of one
key both end with one whole entry; an entry whose manifest doesn't match its library is thrown away and
built again. An entry is never overwritten in place: a library that is already loaded would silently
keep answering for the new one.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import platform
import shutil
import subprocess
import time
import uuid
import zlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import casadi
import platformdirs

from .processes import is_gone
from .trust import why_untrusted

logger = logging.getLogger("stationkeep")

# -O2 without contraction of a*b+c is bit-equal to CasADi's virtual machine.
FLAGS = ("-O2", "-fPIC", "-shared", "-ffp-contract=off")
# For hand-written loops: the vectors of this very processor, whose features belong in the key.
NATIVE_FLAGS = ("-O3", "-fPIC", "-shared", "-march=native", "-ffp-contract=fast")
_TEMPORARY = ".build-"
_STALE_AFTER = 3600.0  # s; a temporary folder older than this was left by a killed build
_HOST = f"{zlib.crc32(platform.node().encode()):08x}"


class CompilationError(Exception):
    """The C code could not be compiled or stored; the virtual machine takes its place."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler: its path and what it says of itself."""

    path: str
    version: str


@dataclass(frozen=True)
class Library:
    """A compiled function: its shared library, its key, and whether it was in the cache."""

    path: Path
    key: str
    cache_hit: bool


def cache_folder() -> Path:
    """Return the cache folder: $STATIONKEEP_CACHE, or the user's cache folder."""
    chosen = os.environ.get("STATIONKEEP_CACHE")
    return Path(chosen) if chosen else Path(platformdirs.user_cache_dir("stationkeep", False))


def find_compiler() -> Compiler | None:
    """Return the system's C compiler ($CC, cc, gcc or clang), or None."""
    chosen = os.environ.get("CC")
    for name in [chosen] if chosen else ["cc", "gcc", "clang"]:
        path = shutil.which(name)
        if path:
            return Compiler(path, _version(path))
    if chosen:
        raise CompilationError(f"the C compiler '{chosen}' that $CC names was not found")
    return None


@cache
def _version(path: str) -> str:
    try:
        answer = subprocess.run(
            [path, "--version"], capture_output=True, text=True, errors="replace", check=False
        )
    except OSError as error:
        raise CompilationError(f"the C compiler '{path}' can't be run ({error.strerror})") from None
    return answer.stdout.partition("\n")[0]


def c_source(function: casadi.Function) -> str:
    """Return the generated C text of a function."""
    generator = casadi.CodeGenerator(function.name(), {"with_header": False})
    generator.add(function)
    return str(generator.dump())


@cache
def _target(path: str) -> str:
    """Return what the compiler defines for this processor: its vector extensions and more."""
    command = [path, "-march=native", "-dM", "-E", "-x", "c", os.devnull]
    answer = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    return "\n".join(sorted(answer.stdout.splitlines()))


def compile_function(function: casadi.Function) -> Library:
    """Return the compiled library of a function, from the cache or newly built.

    Raises as `compile_source`.
    """
    return compile_source(c_source(function), FLAGS)


def compile_source(source: str, flags: tuple[str, ...]) -> Library:
    """Return the compiled library of C code, from the cache or newly built.

    Raises
    ------
    CompilationError
        If there is no compiler, it fails, or the cache folder can't be written.
    """
    compiler = find_compiler()
    if compiler is None:
        raise CompilationError("no C compiler was found (cc, gcc, clang)")
    key = _key(source, compiler, flags)
    folder = cache_folder().expanduser().resolve()
    fault = why_untrusted(folder)
    if fault is not None:
        raise CompilationError(
            f"the cache of compiled functions is not used: {fault}; delete it, or set "
            "STATIONKEEP_CACHE to a folder of your own"
        )
    entry = folder / key
    _tidy(folder)
    if _is_whole(entry):
        return Library(entry / "function.so", key, cache_hit=True)
    try:
        _build(source, compiler, flags, entry)
    except OSError as error:
        reason = error.strerror or str(error)
        raise CompilationError(
            f"the cache folder '{entry.parent}' can't be used ({reason}; set STATIONKEEP_CACHE to "
            "another one)"
        ) from None
    return Library(entry / "function.so", key, cache_hit=False)


def _key(source: str, compiler: Compiler, flags: tuple[str, ...]) -> str:
    parts = (
        source,
        compiler.path,
        compiler.version,
        *flags,
        platform.system(),
        platform.machine(),
        _target(compiler.path) if "-march=native" in flags else "",
        casadi.CasadiMeta.version(),
    )
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _is_whole(entry: Path) -> bool:
    """Return whether an entry is the user's own and its library the one that its manifest names."""
    for path in (entry, entry / "manifest.json", entry / "function.so"):
        fault = why_untrusted(path)
        if fault is not None:
            logger.warning("a compiled function is built again: %s", fault)
            return False
    try:
        manifest = json.loads((entry / "manifest.json").read_text(encoding="utf-8"))
        return bool(manifest["sha256"] == _digest(entry / "function.so"))
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _build(source: str, compiler: Compiler, flags: tuple[str, ...], entry: Path) -> None:
    entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    _remove_stale(entry.parent)
    folder = entry.parent / f"{_TEMPORARY}{_HOST}-{os.getpid()}-{uuid.uuid4().hex}"
    folder.mkdir(mode=0o700)
    try:
        code, library = folder / "function.c", folder / "function.so"
        code.write_text(source, encoding="utf-8")
        command = [compiler.path, *flags, str(code), "-o", str(library), "-lm"]
        answer = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        if answer.returncode != 0 or not library.is_file():
            fault = (answer.stderr.strip() or "no message").partition("\n")[0]
            fault = fault.replace(f"{folder}{os.sep}", "")
            raise CompilationError(f"'{compiler.path}' failed ({fault})")
        manifest = {"sha256": _digest(library), "compiler": compiler.version, "flags": flags}
        (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
        for path in folder.iterdir():
            path.chmod(0o700)  # whatever the umask: what others can write is not loaded
        _publish(folder, entry)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _publish(folder: Path, entry: Path) -> None:
    """Rename a finished build to its key, past a broken entry or another process's whole one."""
    for _ in range(10):
        try:
            folder.rename(entry)
            return
        except OSError:
            if _is_whole(entry):
                return
            if not entry.exists():
                raise
            broken = entry.parent / f"{_TEMPORARY}broken-{uuid.uuid4().hex}"
            with contextlib.suppress(FileNotFoundError):
                entry.rename(broken)
            _remove(broken)
    raise CompilationError(f"the cache entry '{entry}' is broken and can't be replaced; delete it")


@cache
def _tidy(folder: Path) -> None:
    """Remove what killed builds left, once a process."""
    _remove_stale(folder)


def _remove_stale(folder: Path) -> None:
    """Remove what killed builds left: those of this machine at once, of others after a while."""
    for left in folder.glob(f"{_TEMPORARY}*"):
        with contextlib.suppress(OSError):
            if _is_dead(left) or time.time() - left.lstat().st_mtime > _STALE_AFTER:
                _remove(left)


def _is_dead(left: Path) -> bool:
    """Whether a build's folder is that of a process of this machine that is no more."""
    host, _, rest = left.name.removeprefix(_TEMPORARY).partition("-")
    number = rest.partition("-")[0]
    return host == _HOST and number.isdigit() and is_gone(int(number))


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
