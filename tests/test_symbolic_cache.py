"""The compilation cache: hits, keys, damaged entries, killed and simultaneous builds."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import casadi
import numpy as np
import pytest
from stationkeep.symbolic.compiled import compilation, kernel
from stationkeep.symbolic.compiled.compilation import compile_function, find_compiler

COMPILER = find_compiler()
pytestmark = [
    pytest.mark.skipif(COMPILER is None, reason="there is no C compiler"),
    pytest.mark.skipif(os.name != "posix", reason="the fake compilers are shell scripts"),
]
REAL = "" if COMPILER is None else COMPILER.path
POINT = np.array([0.1, 0.2, 0.3])

PROGRAM = """
import sys
import casadi
from stationkeep.symbolic.compiled import kernel
x = casadi.SX.sym("x", 3)
bound, export = kernel.export(casadi.Function("tiny", [x], [casadi.sin(2.0 * x)]))
print(export.compiled, export.cache_hit, export.key, *bound([0.1, 0.2, 0.3])[0])
"""


def tiny(factor: float = 2.0) -> casadi.Function:
    """Return sin(factor x), the function that PROGRAM builds too."""
    x = casadi.SX.sym("x", 3)
    return casadi.Function("tiny", [x], [casadi.sin(factor * x)])


def start() -> subprocess.Popen[str]:
    """Start PROGRAM in a process group of its own, with this process's environment."""
    command = [sys.executable, "-c", PROGRAM]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def works(function: casadi.Function, factor: float = 2.0) -> bool:
    """Return whether a function is exported compiled and gives sin(factor x)."""
    bound, export = kernel.export(function)
    assert bound(POINT)[0] == pytest.approx(np.sin(factor * POINT), rel=1e-15)
    return export.compiled


def left_over(cache: Path) -> list[str]:
    """Return the names in the cache that are not entries."""
    return [path.name for path in cache.iterdir() if len(path.name) != 64]


def wait_for(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait until a condition holds; fail if it does not."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "timed out"
        time.sleep(0.01)


def test_second_call_is_a_hit(empty_cache: Path) -> None:
    """The same function gives the same library without compiling; another one does not."""
    first, second = compile_function(tiny()), compile_function(tiny())
    assert (first.cache_hit, second.cache_hit) == (False, True)
    assert (first.key, first.path) == (second.key, second.path)
    assert first.path.is_relative_to(empty_cache)
    other = compile_function(tiny(3.0))
    assert not other.cache_hit
    assert other.key != first.key
    assert works(tiny())
    assert works(tiny(3.0), 3.0)
    assert left_over(empty_cache) == []


def test_a_hit_needs_no_build(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a filled cache nothing is compiled, not even with a read-only cache."""
    compile_function(tiny())

    def build(*_: object) -> None:
        pytest.fail("compiled again")

    monkeypatch.setattr(compilation, "_build", build)
    assert compile_function(tiny()).cache_hit


def test_flags_are_in_the_key(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """-march=native changes the last digit, so it may not share an entry."""
    first = compile_function(tiny())
    monkeypatch.setattr(compilation, "FLAGS", (*compilation.FLAGS, "-O1"))
    second = compile_function(tiny())
    assert not second.cache_hit
    assert second.key != first.key


def test_compiler_is_in_the_key(
    empty_cache: Path, compiler_script: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another compiler of the same version, or another version at the same path: another entry."""
    keys = [compile_function(tiny()).key]
    script = compiler_script(f'exec "{REAL}" "$@"')
    keys.append(compile_function(tiny()).key)
    twin = shutil.copy(script, script.with_name("twin-cc"))
    monkeypatch.setenv("CC", str(twin))
    keys.append(compile_function(tiny()).key)
    monkeypatch.setattr(compilation, "_version", lambda path: "fake cc 2.0")
    keys.append(compile_function(tiny()).key)
    assert len(set(keys)) == 4
    assert sorted(keys) == sorted(path.name for path in empty_cache.iterdir())


def truncate(entry: Path) -> None:
    library = entry / "function.so"
    library.write_bytes(library.read_bytes()[:4000])


def empty_the_library(entry: Path) -> None:
    (entry / "function.so").write_bytes(b"")


def flip_bytes(entry: Path) -> None:
    library = entry / "function.so"
    content = bytearray(library.read_bytes())
    content[len(content) // 2] ^= 0xFF
    library.write_bytes(bytes(content))


def remove_library(entry: Path) -> None:
    (entry / "function.so").unlink()


def remove_manifest(entry: Path) -> None:
    (entry / "manifest.json").unlink()


def truncate_manifest(entry: Path) -> None:
    (entry / "manifest.json").write_text('{"sha256": "12', encoding="utf-8")


def manifest_of_another_kind(entry: Path) -> None:
    (entry / "manifest.json").write_text(json.dumps(["sha256"]), encoding="utf-8")


def file_in_place(entry: Path) -> None:
    shutil.rmtree(entry)
    entry.write_text("not a folder", encoding="utf-8")


@pytest.mark.parametrize(
    "damage",
    [
        truncate,
        empty_the_library,
        flip_bytes,
        remove_library,
        remove_manifest,
        truncate_manifest,
        manifest_of_another_kind,
        file_in_place,
    ],
)
def test_damaged_entry_is_built_again(empty_cache: Path, damage: Callable[[Path], None]) -> None:
    """A library that is not the one in its manifest is never loaded; the next call is a hit again."""
    entry = compile_function(tiny()).path.parent
    damage(entry)
    again = compile_function(tiny())
    assert not again.cache_hit
    assert again.path.parent == entry
    assert works(tiny())
    assert compile_function(tiny()).cache_hit
    assert left_over(empty_cache) == []


def test_killed_build_leaves_nothing_that_is_used(
    empty_cache: Path, tmp_path: Path, compiler_script: Callable[[str], Path]
) -> None:
    """SIGKILL with half a library written; the same compiler then builds the same key anew."""
    slow = tmp_path / "slow"
    slow.touch()
    compiler_script(f'if [ -e "{slow}" ]; then printf half > "$out"; sleep 60; fi\nexec "{REAL}" "$@"')
    with start() as process:
        wait_for(lambda: any(path.stat().st_size for path in empty_cache.glob("*/function.so")))
        os.killpg(process.pid, signal.SIGKILL)
        assert process.wait(timeout=10) == -signal.SIGKILL
    assert len(left_over(empty_cache)) == 1
    slow.unlink()
    library = compile_function(tiny())
    assert not library.cache_hit
    assert works(tiny())


def test_simultaneous_cold_builds(
    empty_cache: Path, tmp_path: Path, compiler_script: Callable[[str], Path]
) -> None:
    """Two processes compile one key at the same time; both end well, with one whole entry."""
    meeting = tmp_path / "meeting"
    meeting.mkdir()
    compiler_script(
        f'touch "{meeting}/$$"\n'
        f'while [ "$(ls "{meeting}" | wc -l)" -lt 2 ]; do sleep 0.02; done\n'
        f'exec "{REAL}" "$@"'
    )
    with start() as first, start() as second:
        answers = [process.communicate(timeout=60) for process in (first, second)]
        assert first.returncode == second.returncode == 0, answers
    assert len(list(meeting.iterdir())) == 2  # both did compile
    (compiled, hit, key, *values), other = (answer[0].split() for answer in answers)
    assert [compiled, hit, key, *values] == other
    assert (compiled, hit) == ("True", "False")
    assert [float(value) for value in values] == pytest.approx(np.sin(2.0 * POINT), rel=1e-15)
    assert [path.name for path in empty_cache.iterdir()] == [key]
    assert compile_function(tiny()).cache_hit


def test_left_overs_of_killed_builds_are_removed_in_time(empty_cache: Path) -> None:
    """Those older than an hour; a younger one may belong to a build that is under way."""
    old, young = empty_cache / ".build-1-old", empty_cache / ".build-2-young"
    for folder in (old, young):
        folder.mkdir(parents=True)
        (folder / "function.c").write_text("int x;", encoding="utf-8")
    two_hours_ago = time.time() - 7200.0
    os.utime(old, (two_hours_ago, two_hours_ago))
    compile_function(tiny())
    assert left_over(empty_cache) == [young.name]


def test_the_processor_is_in_the_key_of_native_code(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cache folder may be shared by machines with other vector extensions."""
    source = "double twice(double x) { return x + x; }\n"
    first = compilation.compile_source(source, compilation.NATIVE_FLAGS)
    assert compilation.compile_source(source, compilation.NATIVE_FLAGS).cache_hit
    monkeypatch.setattr(compilation, "_target", lambda path: "another processor")
    second = compilation.compile_source(source, compilation.NATIVE_FLAGS)
    assert not second.cache_hit
    assert first.key != second.key
