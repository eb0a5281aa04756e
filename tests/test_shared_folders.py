"""What others have put into a folder is neither loaded, nor followed, nor changed."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import casadi
import pytest
from stationkeep.comparison.sweep.sweep_table import Journal
from stationkeep.online.records import writable_folder
from stationkeep.symbolic import InputError
from stationkeep.symbolic.compiled.compilation import (
    CompilationError,
    compile_function,
    find_compiler,
)

pytestmark = pytest.mark.skipif(
    not hasattr(os, "geteuid") or find_compiler() is None, reason="needs owners of files and a compiler"
)
Check = Callable[[BaseException], str]


def doubled() -> casadi.Function:
    x = casadi.SX.sym("x")
    return casadi.Function("doubled", [x], [2.0 * x])


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """A library that leaves a mark where it is loaded, with a manifest that names it."""
    folder = tmp_path / "planted"
    folder.mkdir()
    source = folder / "function.c"
    mark = folder / "ran"
    source.write_text(
        "#include <stdio.h>\n__attribute__((constructor)) static void go(void)\n"
        f'{{ FILE *file = fopen("{mark}", "w"); if (file) fclose(file); }}\n'
    )
    library = folder / "function.so"
    compiler = find_compiler()
    assert compiler is not None
    subprocess.run([compiler.path, "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
    digest = hashlib.sha256(library.read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps({"sha256": digest}))
    return folder


def value(path: Path) -> float:
    """Return what the library makes of 3, loaded in a process of its own."""
    text = f"import casadi; print(casadi.external('doubled', {str(path)!r})(3.0))"
    answer = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    return float(answer.stdout)


def test_the_cache_is_made_for_its_owner_alone(empty_cache: Path) -> None:
    before = os.umask(0)
    try:
        library = compile_function(doubled())
    finally:
        os.umask(before)
    for path in (empty_cache, library.path.parent, *library.path.parent.iterdir()):
        assert path.stat().st_mode & 0o077 == 0, path
    assert compile_function(doubled()).cache_hit


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o1777])
def test_a_folder_that_others_can_write_is_not_used(
    empty_cache: Path, mode: int, one_sentence: Check
) -> None:
    compile_function(doubled())
    empty_cache.chmod(mode)
    with pytest.raises(CompilationError) as caught:
        compile_function(doubled())
    text = one_sentence(caught.value)
    assert str(empty_cache) in text
    assert "written by others" in text


def test_a_folder_above_that_others_can_write(empty_cache: Path) -> None:
    """They could put another folder in its place; not where the sticky bit is set, as in /tmp."""
    compile_function(doubled())
    empty_cache.parent.chmod(0o1777)
    assert compile_function(doubled()).cache_hit
    empty_cache.parent.chmod(0o777)
    with pytest.raises(CompilationError, match="written by others"):
        compile_function(doubled())


@pytest.mark.parametrize(
    "how", ["writable entry", "writable library", "link", "linked library", "owner"]
)
def test_a_planted_entry_is_built_again(
    empty_cache: Path, planted: Path, how: str, caplog: pytest.LogCaptureFixture
) -> None:
    entry = compile_function(doubled()).path.parent
    if how == "link":
        entry.rename(empty_cache / "away")
        entry.symlink_to(planted, target_is_directory=True)
    elif how == "linked library":
        for name in ("function.so", "manifest.json"):
            (entry / name).unlink()
            (entry / name).symlink_to(planted / name)
    else:
        for name in ("function.so", "manifest.json"):
            (entry / name).write_bytes((planted / name).read_bytes())
        if how == "owner":
            if os.geteuid() != 0:
                pytest.skip("only root can give files away")
            os.chown(entry / "function.so", 12345, 12345)
        else:
            (entry if how == "open entry" else entry / "function.so").chmod(0o777)
    with caplog.at_level(logging.WARNING, logger="stationkeep"):
        library = compile_function(doubled())
    assert not library.cache_hit
    assert "built again" in caplog.text
    assert value(library.path) == 6.0
    assert not (planted / "ran").exists()
    assert (planted / "function.so").is_file(), "what a link points to stays"


def test_a_build_that_was_killed_leaves_nothing(empty_cache: Path) -> None:
    compile_function(doubled())
    (own,) = (path for path in [empty_cache] if path.is_dir())
    from stationkeep.symbolic.compiled import compilation

    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    left = own / f".build-{compilation._HOST}-{dead.pid}-0"
    alive = own / f".build-{compilation._HOST}-{os.getpid()}-0"
    elsewhere = own / f".build-{'0' * 8}-{dead.pid}-0"
    for path in (left, alive, elsewhere):
        path.mkdir()
    x = casadi.SX.sym("x")
    compile_function(casadi.Function("tripled", [x], [3.0 * x]))
    assert not left.exists()
    assert alive.exists()
    assert elsewhere.exists()


@pytest.mark.parametrize("how", ["link", "hard link", "text", "folder", "pipe"])
def test_what_is_no_journal_stays_as_it_is(tmp_path: Path, how: str, one_sentence: Check) -> None:
    """It would be given lines, and its torn last line would be cut off."""
    precious = tmp_path / "precious"
    precious.write_bytes(b"first line\nno newline at its end")
    path = tmp_path / "sweep.journal"
    if how == "link":
        path.symlink_to(precious)
    elif how == "hard link":
        path.hardlink_to(precious)
    elif how == "text":
        path.write_bytes(precious.read_bytes())
    elif how == "folder":
        path.mkdir()
    else:
        os.mkfifo(path)
    with pytest.raises(InputError) as caught:
        Journal(path)
    assert str(path) in one_sentence(caught.value)
    assert precious.read_bytes() == b"first line\nno newline at its end"


def test_what_killed_runs_left_in_a_folder_goes(tmp_path: Path) -> None:
    """Of processes that are no more; what is being written, or is a user's own, stays."""
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    (tmp_path / "figures").mkdir()
    left = [tmp_path / f".report.html-{dead.pid}-0123abcd"]
    left.append(tmp_path / "figures" / f".regret.pdf-{dead.pid}-89abcdef")
    stays = [tmp_path / f".report.html-{os.getpid()}-0123abcd", tmp_path / ".own-notes-2026"]
    stays.append(tmp_path / "report.html")
    for path in (*left, *stays):
        path.touch()
    assert writable_folder(tmp_path) == tmp_path
    assert not any(path.exists() for path in left)
    assert all(path.exists() for path in stays)
