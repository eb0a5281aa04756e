"""The Python blocks of docs/*.md run as they are, those of one file in one namespace.

A block after `<!-- slow -->` belongs to the slow evidence.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"(<!-- slow -->\s*)?^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
PAGES = sorted((ROOT / "docs").glob("*.md"))


def code(page: Path, *, slow: bool) -> str:
    """Return the blocks of a page as one program; without the slow ones unless these are asked for."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return "\n".join(block for mark, block in found if slow or not mark)


def is_slow(page: Path) -> bool:
    return any(mark for mark, _ in BLOCK.findall(page.read_text(encoding="utf-8")))


def runs(program: str, folder: Path, seconds: float) -> None:
    path = folder / "blocks.py"
    path.write_text(program, encoding="utf-8")
    command = [sys.executable, str(path)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=seconds)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", [p for p in PAGES if code(p, slow=False)], ids=lambda page: page.name)
def test_blocks_run(page: Path, tmp_path: Path) -> None:
    runs(code(page, slow=False), tmp_path, 120)


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in PAGES if is_slow(p)], ids=lambda page: page.name)
def test_slow_blocks_run(page: Path, tmp_path: Path) -> None:
    runs(code(page, slow=True), tmp_path, 600)
