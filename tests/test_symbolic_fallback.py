"""Without a usable compiler or cache: CasADi's virtual machine, the same numbers, one message."""

from __future__ import annotations

import errno
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest
from stationkeep.symbolic import Model, Vehicle
from stationkeep.symbolic.compiled import kernel
from stationkeep.symbolic.compiled.compilation import find_compiler

from .fossen import random_states

COMPILER = find_compiler()
REAL = "" if COMPILER is None else COMPILER.path
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")
pytestmark = pytest.mark.skipif(os.name != "posix", reason="the fake compilers are shell scripts")
POINT = np.array([0.1, 0.2, 0.3])


def falls_back(caplog: pytest.LogCaptureFixture, n_functions: int = 3) -> str:
    """Export functions; check that none is compiled, all are right, and return the one message."""
    with caplog.at_level(logging.DEBUG, logger="stationkeep"):
        for factor in range(1, n_functions + 1):
            x = casadi.SX.sym("x", 3)
            function = casadi.Function(f"tiny_{factor}", [x], [casadi.sin(factor * x)])
            bound, export = kernel.export(function)
            assert not export.compiled
            assert export.key is None
            assert export.max_difference == 0.0
            assert bound(POINT)[0] == pytest.approx(np.sin(factor * POINT), rel=1e-15)
    messages = [record.getMessage() for record in caplog.records if record.name == "stationkeep"]
    assert len(messages) == 1, messages
    assert "virtual machine" in messages[0]
    assert "\n" not in messages[0]
    return messages[0]


def test_no_compiler_on_the_path(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """An empty PATH."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    assert "no C compiler" in falls_back(caplog)
    assert not empty_cache.exists()


def test_CC_names_nothing(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A $CC that does not exist is not replaced by another compiler, and the message names it."""
    monkeypatch.setenv("CC", "no-such-cc")
    assert "no-such-cc" in falls_back(caplog)


def test_model_without_a_compiler(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same f and g from the virtual machine as from the compiled functions."""
    vehicle = Vehicle.load("rexrov")
    compiled = Model(vehicle)
    zeta = random_states(1)[0]
    expected = compiled.drift(zeta), compiled.input_matrix(zeta)
    monkeypatch.setenv("CC", "no-such-cc")
    model = Model(vehicle)
    assert np.linalg.norm(model.drift(zeta) - expected[0]) <= 1e-12 * np.linalg.norm(expected[0])
    g = model.input_matrix(zeta)
    assert np.linalg.norm(g - expected[1]) <= 1e-12 * np.linalg.norm(expected[1])
    assert not any(export.compiled for export in model.exports())


@pytest.mark.parametrize(
    ("body", "word"),
    [
        ("echo 'internal compiler error' >&2; exit 1", "internal compiler error"),
        ('echo "$source:3:1: error: no math.h" >&2; exit 1', "no math.h"),
        ("exit 1", "fake-cc"),
        ("exit 0", "fake-cc"),  # claims success and writes nothing
        ("printf 'caf\\351: error' >&2; exit 1", "error"),  # says it in Latin-1
        ('echo "not a library" > "$out"', "load"),
        ("kill -9 $$", "fake-cc"),
    ],
    ids=["fails", "names-its-file", "silent", "writes-nothing", "latin-1", "garbage", "killed"],
)
def test_compiler_that_fails(
    body: str,
    word: str,
    empty_cache: Path,
    compiler_script: Callable[[str], Path],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Whatever it does; the reason is in the message, which comes once."""
    compiler_script(body)
    assert word in falls_back(caplog)
    left = [path for path in empty_cache.iterdir() if path.name.startswith(".build-")]
    assert left == []


def test_compiler_that_can_not_be_run(
    empty_cache: Path, compiler_script: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    """An executable file that is no program (for instance of another machine)."""
    compiler_script("").write_bytes(b"\x7fELF not really")
    assert "fake-cc" in falls_back(caplog)


@needs_compiler
def test_compiler_that_computes_something_else(
    empty_cache: Path, compiler_script: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    """A miscompiled function is noticed by its numbers."""
    compiler_script(
        'sed "s/sin(/cos(/g" "$source" > "$source.changed.c"\n'
        f'exec "{REAL}" -O2 -fPIC -shared "$source.changed.c" -o "$out" -lm'
    )
    x = casadi.SX.sym("x", 3)
    with caplog.at_level(logging.WARNING, logger="stationkeep"):
        bound, export = kernel.export(casadi.Function("tiny", [x], [casadi.sin(x)]))
    assert not export.compiled
    assert bound(POINT)[0] == pytest.approx(np.sin(POINT), rel=1e-15)
    assert "differs from its source" in caplog.text


@needs_compiler
@pytest.mark.parametrize("below", ["", "deeper/still"])
def test_cache_that_is_a_file(
    below: str,
    tmp_path: Path,
    empty_cache: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A file where the folder should be; it is left alone."""
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    monkeypatch.setenv("STATIONKEEP_CACHE", str(file / below))
    message = falls_back(caplog)
    assert str(file / below) in message
    assert "STATIONKEEP_CACHE" in message
    assert file.read_text(encoding="utf-8") == "mine"


@needs_compiler
@pytest.mark.parametrize("name", ["function.c", "manifest.json"])
def test_full_disk(
    name: str, empty_cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """No space left for the source, or for the manifest after the library."""
    write_text = Path.write_text

    def full(path: Path, *arguments: Any, **options: Any) -> int:
        if path.name == name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write_text(path, *arguments, **options)

    monkeypatch.setattr(Path, "write_text", full)
    message = falls_back(caplog)
    assert str(empty_cache) in message
    assert os.strerror(errno.ENOSPC) in message
    assert list(empty_cache.iterdir()) == []


LIMITED = """
import resource
import sys
import casadi
from stationkeep.symbolic.compiled import kernel
x = casadi.SX.sym("x", 3)
limit = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
for factor in (1, 2):
    bound, export = kernel.export(casadi.Function("tiny", [x], [casadi.sin(factor * x)]))
    print(export.compiled, *bound([0.1, 0.2, 0.3])[0])
"""


@needs_compiler
@pytest.mark.parametrize("limit", [100, 5000], ids=["source", "library"])
def test_files_that_can_not_grow(limit: int, empty_cache: Path) -> None:
    """A real limit on the size of a file: the source, or what the compiler writes, is cut off."""
    command = [sys.executable, "-c", LIMITED, str(limit)]
    answer = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    for factor, line in enumerate(answer.stdout.splitlines(), start=1):
        compiled, *values = line.split()
        assert compiled == "False"
        assert [float(value) for value in values] == pytest.approx(np.sin(factor * POINT), rel=1e-15)
    assert answer.stderr.count("virtual machine") == 1, answer.stderr
    assert list(empty_cache.iterdir()) == []


@needs_compiler
def test_compiled_on_request_only(empty_cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    """compiled=False is silent and touches no cache."""
    x = casadi.SX.sym("x", 3)
    function = casadi.Function("tiny", [x], [casadi.sin(x)])
    _, export = kernel.export(function, compiled=False)
    assert not export.compiled
    assert not caplog.records
    assert not empty_cache.exists()
