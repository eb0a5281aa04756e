"""What is on the pages for people, the README and docs/: code blocks, inline code, links, headings."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from functools import cache
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import BaseModel
from stationkeep.cli.main import COMMANDS, parser
from stationkeep.comparison import Scenario

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
PAGES = sorted((ROOT / "docs").rglob("*.md"))
FENCED = re.compile(r"(?:<!-- (.*?) -->\n)?^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
OPTION = re.compile(r"--[a-z][a-z-]*")


class Block(NamedTuple):
    """A code block: the comment before it, its language and its text."""

    mark: str
    language: str
    text: str


def name_of(page: Path) -> str:
    """Return a page's path as a test's name."""
    return str(page.relative_to(ROOT))


def blocks(text: str) -> list[Block]:
    """Return the code blocks of a page's text, in order."""
    return [Block(*found) for found in FENCED.findall(text)]


def read(page: Path) -> list[Block]:
    """Return the code blocks of a page, in order."""
    return blocks(page.read_text(encoding="utf-8"))


def inline(text: str) -> list[str]:
    """Return what stands in backticks outside of blocks, each in one line."""
    return [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", FENCED.sub("", text))]


def commands(text: str) -> Iterator[list[str]]:
    """Yield the words after `stationkeep` of each command line of a shell block."""
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["stationkeep"]:
            yield words[1:]


def mentioned(span: str) -> list[str] | None:
    """Return the words of a command that inline code mentions, None where it mentions none.

    It begins with `stationkeep`, or with a command that has an option behind it.
    """
    words = span.split()
    if words[0] == "stationkeep":
        return words[1:] or None
    return words if words[0] in COMMANDS and OPTION.search(span) else None


def unknown(words: list[str]) -> list[str]:
    """Return what of a command line does not exist: the command itself, or options of it."""
    if words[0] == "COMMAND" or words[0].startswith("-"):
        return [word for word in words if word.startswith("--") and word not in help_of("")]
    names = re.split(r"\|", words[0])
    missing = [name for name in names if name not in COMMANDS]
    options = [option for word in words for option in OPTION.findall(word)]
    known = set().union(*(help_of(name) for name in names if name in COMMANDS))
    return missing + [option for option in options if option not in known]


@cache
def help_of(command: str) -> frozenset[str]:
    """Return the options that the help of a command lists; of the whole for the empty name."""
    text = StringIO()
    with redirect_stdout(text), suppress(SystemExit):
        parser().parse_args([command, "--help"] if command else ["--help"])
    return frozenset(OPTION.findall(text.getvalue()))


def links(text: str) -> list[str]:
    """Return the targets of a page's links and images that are no web address."""
    return re.findall(r"\]\((?!https?:)([^)]+)\)", FENCED.sub("", text))


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", FENCED.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken(page: Path) -> list[str]:
    """Return the links of a page whose file or heading does not exist."""
    found = []
    for target in links(page.read_text(encoding="utf-8")):
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists() or (anchor and anchor not in anchors(path.read_text(encoding="utf-8"))):
            found.append(target)
    return found


def exists(dotted: str) -> bool:
    """Return whether a dotted name is something of the package, or a setting of a scenario."""
    parts = dotted.removeprefix("stationkeep.").split(".")
    return _attribute(parts) or _setting(Scenario, parts)


def _attribute(parts: list[str]) -> bool:
    for cut in range(len(parts), -1, -1):
        try:
            found: Any = import_module(".".join(["stationkeep", *parts[:cut]]))
        except ImportError:
            continue
        for name in parts[cut:]:
            fields = getattr(found, "__dataclass_fields__", {}) | getattr(found, "model_fields", {})
            if not hasattr(found, name) and name not in fields:
                return False
            found = getattr(found, name, None)
        return True
    return False


def _setting(group: type[BaseModel], parts: list[str]) -> bool:
    field = group.model_fields.get(re.sub(r"\[\w+\]$", "", parts[0]))
    if field is None:
        return False
    if len(parts) == 1:
        return True
    kind = field.annotation
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return _setting(kind, parts[1:])
    return "dict" in str(kind)


def program(page: list[Block], *, slow: bool) -> str:
    """Return a page as one program; without what is slow unless it is asked for."""
    lines = ["import sys", "from pathlib import Path", "from stationkeep.cli.main import main"]
    lines.append("sys.path.insert(0, '.')")
    for mark, language, text in page:
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
                lines.append(f"assert main({words!r}) == 0")
    return "\n".join(lines)
