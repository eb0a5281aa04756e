"""The README as a new user takes it: its length, its set-up commands, its table of functions."""

from __future__ import annotations

import re

import pytest
import stationkeep
from stationkeep.cli.main import COMMANDS
from stationkeep.comparison import Scenario
from stationkeep.comparison.policies import CONTENDERS

from .pages import README, ROOT, exists, inline, read

TEXT = README.read_text(encoding="utf-8")
LONGEST = 150  # lines
OTHER_WORDS = {"stationkeep"}


def rows() -> list[list[str]]:
    """Return the names in each row of the table of equations and functions."""
    table = TEXT[TEXT.index("## Equations and functions") : TEXT.index("## Departures")]
    lines = [line for line in table.splitlines() if line.startswith("| ")][1:]
    return [inline(line.split("|")[3]) for line in lines]


def test_it_is_short() -> None:
    assert len(TEXT.splitlines()) <= LONGEST


def test_continuous_integration_runs_the_two_set_up_commands_literally() -> None:
    first, second = [block.text.strip() for block in read(README) if block.language == "sh"][:2]
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert "stationkeep compare" in first
    assert "pytest" in second
    assert first in lines
    assert second in lines


def test_the_table_of_equations_names_what_exists() -> None:
    assert len(rows()) > 10
    for names in rows():
        assert names
        module = ""
        for name in names:  # a bare name is of the module before it, or at the top
            if "." in name:
                module = name.rpartition(".")[0]
                assert exists(name), name
            else:
                assert name in stationkeep.__all__ or exists(f"{module}.{name}"), name


@pytest.mark.parametrize("word", sorted({w for w in inline(TEXT) if re.fullmatch(r"[a-z-]+\d?", w)}))
def test_a_word_in_backticks_is_a_command_a_policy_or_a_scenario(word: str) -> None:
    functions = {name for names in rows() for name in names}
    known = {*COMMANDS, *stationkeep.__all__, *CONTENDERS, *Scenario.shipped(), *functions}
    assert word in known | OTHER_WORDS
