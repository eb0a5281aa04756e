"""The code blocks of the README and docs/ run in the order of a page, in one folder and one namespace.

Python blocks run as they are. A TOML block whose first line is `# NAME.toml` is that file, and so is a
Python block after `<!-- file: NAME -->`. A shell block is parsed as command lines, and run after
`<!-- run -->`. A page with a block after `<!-- slow -->` runs once without these blocks, and once with
them as slow evidence. What stands in backticks exists: commands and their options, names of the
package, settings, files.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from stationkeep.cli.main import COMMANDS, parser

from .pages import (
    PAGES,
    README,
    ROOT,
    anchors,
    blocks,
    broken,
    commands,
    exists,
    inline,
    links,
    mentioned,
    name_of,
    program,
    read,
    unknown,
)
from .test_wings import WINGS

EVERY = [README, *PAGES, *(ROOT / name / "README.md" for name in ("benchmarks", "examples"))]
FOLDERS = "symbolic|online|offline|comparison|cli"
GROUPS = "game|envelope|basis|learner|samples|simulation"
FILES = re.compile(rf"(?:{FOLDERS}|api|benchmarks|examples|tests|docs|\.ci)/[\w./-]*")
NAMES = re.compile(rf"(?:stationkeep|{FOLDERS}|{GROUPS})(?:\.[A-Za-z_]\w*(?:\[i\])?)+")
RUN = """
from pathlib import Path
if __name__ == "__main__":
    exec(compile(Path("page.txt").read_text(encoding="utf-8"), "page.txt", "exec"))
"""


def runs(text: str, folder: Path, seconds: float) -> None:
    (folder / "page.txt").write_text(text, encoding="utf-8")
    path = folder / "page.py"  # whose workers do not run the page again
    path.write_text(RUN, encoding="utf-8")
    command = [sys.executable, str(path)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=seconds)
    assert done.returncode == 0, done.stderr


QUICK = ("problem",)  # pages whose blocks run every time


def is_slow(page: Path) -> bool:
    return any(block.mark == "slow" for block in read(page))


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[] if page.stem in QUICK else [pytest.mark.slow])
        for page in [README, *PAGES]
        if read(page)
    ],
    ids=name_of,
)
def test_blocks_run(page: Path, tmp_path: Path) -> None:
    runs(program(read(page), slow=False), tmp_path, 240)


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in [README, *PAGES] if is_slow(p)], ids=name_of)
def test_slow_blocks_run(page: Path, tmp_path: Path) -> None:
    runs(program(read(page), slow=True), tmp_path, 1800)


@pytest.mark.parametrize("page", [p for p in [README, *PAGES] if read(p)], ids=name_of)
def test_commands_are_commands(page: Path) -> None:
    for block in read(page):
        for words in commands(block.text) if block.language == "sh" else ():
            assert parser().parse_args(words).command in COMMANDS


@pytest.mark.parametrize("page", EVERY, ids=name_of)
def test_commands_in_a_sentence_exist_with_their_options(page: Path) -> None:
    for span in inline(page.read_text(encoding="utf-8")):
        words = mentioned(span)
        assert words is None or unknown(words) == [], span


@pytest.mark.parametrize("page", [README, *PAGES], ids=name_of)
def test_names_settings_and_files_in_a_sentence_exist(page: Path) -> None:
    for span in inline(page.read_text(encoding="utf-8")):
        words = span.split()
        if FILES.fullmatch(words[-1]):
            assert (ROOT / words[-1]).exists(), span
        elif NAMES.fullmatch(span):
            assert exists(span), span


@pytest.mark.parametrize("page", [*EVERY, ROOT / "CHANGELOG.md"], ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    assert broken(page) == []


def test_every_page_is_in_the_index() -> None:
    index = ROOT / "docs" / "README.md"
    listed = {(index.parent / target).resolve() for target in links(index.read_text(encoding="utf-8"))}
    assert {page for page in PAGES if page != index} <= listed


def test_pages_that_sources_name_exist() -> None:
    sources = [path for folder in FOLDERS.split("|") for path in (ROOT / folder).rglob("*.py")]
    for path in [*sources, *(ROOT / "benchmarks").rglob("*.py")]:
        for name in re.findall(r"docs/[\w/-]+\.md", path.read_text(encoding="utf-8")):
            assert (ROOT / name).is_file(), f"{name_of(path)}: {name}"


@pytest.mark.parametrize(
    ("span", "missing"),
    [
        ("stationkeep animate RECORD", ["animate"]),
        ("stationkeep compare --n-states 3", []),
        ("stationkeep compare --film", ["--film"]),
        ("compare --animation", []),
        ("sweep --gammas 2", ["--gammas"]),
        ("stationkeep offline|check --json", []),
        ("stationkeep --version", []),
    ],
)
def test_what_does_not_exist_is_found(span: str, missing: list[str]) -> None:
    words = mentioned(span)
    assert words is not None
    assert unknown(words) == missing


@pytest.mark.parametrize("span", ["compare", "--set", "ruff check --fix", "online"])
def test_what_is_no_command_line_is_left_alone(span: str) -> None:
    assert mentioned(span) is None


@pytest.mark.parametrize(
    ("name", "there"),
    [
        ("online.paper.critic_rate", True),
        ("online.paper.no_such", False),
        ("stationkeep.compare", True),
        ("simulation.chi", True),
        ("simulation.disturbance.kind", True),
        ("simulation.no_such", False),
        ("offline.value_tolerance", True),
        ("learner", True),
    ],
)
def test_names_are_looked_up(name: str, there: bool) -> None:
    assert exists(name) is there


def test_a_page_is_taken_apart() -> None:
    text = "# One, two: *3*\n`a\nb` and [c](d.md#e)\n<!-- run -->\n```sh\n`x` [y](z)\n```\n"
    assert inline(text) == ["a b"]
    assert links(text) == ["d.md#e"]
    assert anchors(text) == {"one-two-3"}
    assert blocks(text) == [("run", "sh", "`x` [y](z)\n")]


@pytest.mark.parametrize("folder", WINGS)
def test_the_architecture_page_has_every_wing(folder: str) -> None:
    named = inline((ROOT / "docs" / "architecture.md").read_text(encoding="utf-8"))
    for wing in WINGS[folder]:
        assert f"{folder}/{wing}/" in named or f"{folder}/{wing}.py" in named
