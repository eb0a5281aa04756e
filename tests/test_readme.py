"""The README as a new user takes it: its set-up commands, its code, its figures."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """Return the code blocks of a language, in order."""
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


def test_continuous_integration_runs_the_two_set_up_commands_literally() -> None:
    first, second = (block.strip() for block in blocks("sh")[:2])
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert "stationkeep compare" in first
    assert "pytest" in second
    assert first in lines
    assert second in lines


@pytest.mark.parametrize("block", blocks("python"), ids=lambda block: block.splitlines()[0])
def test_code_runs(block: str) -> None:
    exec(compile(block, "README.md", "exec"), {})


def test_figures_and_files_exist() -> None:
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", TEXT):
        assert (ROOT / target).exists(), target
