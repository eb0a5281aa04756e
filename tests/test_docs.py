"""The code blocks of docs/*.md run in the order of a page, in one folder and one namespace.

Python blocks run as they are. A TOML block whose first line is `# NAME.toml` is that file, and so is a
Python block after `<!-- file: NAME -->`. A shell block is parsed as command lines, and run after
`<!-- run -->`. A page with a block after `<!-- slow -->` runs once without these blocks, and once with
them as slow evidence.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from stationkeep.cli.main import COMMANDS, parser

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"(?:<!-- (.*?) -->\n)?^```(python|toml|sh)\n(.*?)^```", re.DOTALL | re.MULTILINE)
PAGES = sorted((ROOT / "docs").glob("*.md"))


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Return mark, language and text of each block."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def commands(text: str) -> Iterator[list[str]]:
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["stationkeep"]:
            yield words[1:]


def program(page: Path, *, slow: bool) -> str:
    """Return the page as one program; without what is slow unless it is asked for."""
    lines = ["import subprocess, sys", "from pathlib import Path"]
    for mark, language, text in blocks(page):
        if mark == "slow" and not slow:
            continue
        name = re.match(r"# (\S+\.toml)\n", text)
        if language == "toml" and name:
            lines.append(f"Path({name[1]!r}).write_text({text!r})")
        elif mark.startswith("file: "):
            lines.append(f"Path({mark.removeprefix('file: ')!r}).write_text({text!r})")
        elif language == "python":
            lines.append(text)
        elif language == "sh" and mark in ("run", "slow"):
            for words in commands(text):
                call = ["-m", "stationkeep.cli.main", *words]
                lines.append(f"subprocess.run([sys.executable, *{call!r}], check=True)")
    return "\n".join(lines)


def runs(text: str, folder: Path, seconds: float) -> None:
    path = folder / "page.py"
    path.write_text(text, encoding="utf-8")
    command = [sys.executable, str(path)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=seconds)
    assert done.returncode == 0, done.stderr


def is_slow(page: Path) -> bool:
    return any(mark == "slow" for mark, _, _ in blocks(page))


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p)], ids=lambda page: page.name)
def test_blocks_run(page: Path, tmp_path: Path) -> None:
    runs(program(page, slow=False), tmp_path, 120)


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in PAGES if is_slow(p)], ids=lambda page: page.name)
def test_slow_blocks_run(page: Path, tmp_path: Path) -> None:
    runs(program(page, slow=True), tmp_path, 900)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p)], ids=lambda page: page.name)
def test_commands_are_commands(page: Path) -> None:
    for _, language, text in blocks(page):
        for words in commands(text) if language == "sh" else ():
            assert parser().parse_args(words).command in COMMANDS
