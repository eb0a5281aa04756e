"""The benchmark scripts fit the package: each can be loaded, so no name that it takes is gone."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "benchmarks"
FOLDERS = [FOLDER, FOLDER / "offline", FOLDER / "speed"]  # of scripts
LOAD = """
import importlib, sys
sys.path.insert(0, sys.argv[1])
for name in sys.argv[2:]:
    importlib.import_module(name)
"""


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_each_can_be_loaded(folder: Path, tmp_path: Path) -> None:
    names = sorted(path.stem for path in folder.glob("*.py"))
    if folder == FOLDER:
        assert "regret" in names
        names += sorted(f"studies.{path.stem}" for path in (folder / "studies").glob("*.py"))
    command = [sys.executable, "-B", "-c", LOAD, str(folder), *names]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "", "nothing runs on loading"


def test_every_script_is_in_one_of_the_folders_and_in_the_index() -> None:
    index = (FOLDER / "README.md").read_text(encoding="utf-8")
    for folder in FOLDERS:
        for path in folder.glob("*.py"):
            assert f"`{path.relative_to(FOLDER)}`" in index
    for name in (path.name for path in (FOLDER / "studies").glob("[a-z]*.py")):
        assert f"`{name}`" in index


def test_scripts_that_documents_name_exist() -> None:
    for page in (ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")):
        for name in re.findall(r"benchmarks/[\w/]+\.py", page.read_text(encoding="utf-8")):
            assert (ROOT / name).is_file(), f"{page.name}: {name}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "options"),
    [("fuzz.py", ["--inputs", "100", "--flips", "25"]), ("kills.py", ["--kills", "4"])],
)
def test_wrong_inputs_and_kills(script: str, options: list[str], tmp_path: Path) -> None:
    """A seeded part of what the scripts do by the thousand and the hundred."""
    command = [sys.executable, str(FOLDER / script), *options]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout
    assert " 0 faults" in done.stdout
