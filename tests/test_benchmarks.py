"""The benchmark scripts fit the package: each can be loaded, so no name that it takes is gone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
LOAD = """
import importlib, sys
sys.path.insert(0, sys.argv[1])
for name in sys.argv[2:]:
    importlib.import_module(name)
"""


def test_each_can_be_loaded(tmp_path: Path) -> None:
    names = sorted(path.stem for path in FOLDER.glob("*.py"))
    assert "regret" in names
    command = [sys.executable, "-B", "-c", LOAD, str(FOLDER), *names]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "", "nothing runs on loading"
