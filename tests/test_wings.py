"""The wings: who imports whom inside a folder, through which faces, and how much a folder holds.

A wing is a folder with an `__init__`, its face, or a single module that stands beside the wings. A
module may import those of its own wing, and the faces of what stands before its wing in `WINGS`; from
another folder, that folder's face or one of its wings'.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# in each folder the wings from the ground up: one imports only those before it
WINGS = {
    "symbolic": (
        *("arrays", "errors", "toml", "pyfile", "expressions", "integration", "compiled"),
        *("game", "value", "underwater", "textbook"),
    ),
    "online": (
        *("paper", "vector", "laws", "rows", "learning"),
        *("loop", "vehicle", "records", "simulate"),
    ),
    "offline": (
        *("limits", "path", "settings", "direct", "saddle", "certificate", "solve"),
        *("responses", "ideal_weights"),
    ),
    "comparison": (
        *("scenario", "policies", "parallel", "merit", "records", "optima"),
        *("theory", "study", "sweep", "report", "compare", "adapters"),
    ),
    "cli": (
        *("interrupt", "options", "output", "states", "solving"),
        *("gamma", "saddle", "ideal_weights", "commands", "main"),
    ),
}
MOST_ENTRIES = 13  # of a folder: about a dozen


@dataclass(frozen=True)
class Import:
    """A line that imports something of ours."""

    source: tuple[str, ...]  # folder, wing and module of the file
    line: int
    target: tuple[str, ...]  # the module or package that is named

    def fault(self, wings: dict[str, tuple[str, ...]]) -> str | None:
        """Return what is wrong with it, in one sentence, or None."""
        where = f"{'/'.join(self.source)}.py:{self.line} imports {'.'.join(self.target)}"
        folder, wing = self.source[0], self.source[1]
        other = self.target[0]
        if other != folder:
            deep = len(self.target) > 2 or (
                len(self.target) == 2 and self.target[1] not in wings[other]
            )
            return f"{where}, past the face of {'.'.join(self.target[:2])}" if deep else None
        if wing == "__init__":  # the folder's own face
            return f"{where}, past a wing's face" if len(self.target) > 2 else None
        if len(self.target) == 1:
            return f"{where}, the face of its own folder"
        if self.target[1] == wing:
            return None
        if len(self.target) > 2:
            return f"{where}, past the face of {'.'.join(self.target[:2])}"
        if wings[folder].index(self.target[1]) > wings[folder].index(wing):
            return f"{where}, upwards"
        return None


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def is_module(path: Path) -> bool:
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


@cache
def imports(root: Path, folder: str) -> tuple[Import, ...]:
    """Return the lines of a folder that import something of ours."""
    found = []
    for path in sorted((root / folder).rglob("*.py")):
        source = path.relative_to(root).with_suffix("").parts
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and node.level:
                package = source[: len(source) - node.level]
                base = (*package, *(node.module or "").split(".")) if node.module else package
                for target in {_named(root, base, alias.name) for alias in node.names}:
                    found.append(Import(source, node.lineno, target))
    return tuple(found)


def _named(root: Path, base: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Return the module that `from base import name` names: base, or its submodule `name`."""
    exported = root.joinpath(*base, "__init__.py")
    if not base:
        return (name,)
    if is_module(root.joinpath(*base, name)) and name not in _exports(exported):
        return (*base, name)
    return base


@cache
def _exports(face: Path) -> set[str]:
    """Return what a face exports."""
    if not face.is_file():
        return set()
    for node in tree(face).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return set(ast.literal_eval(node.value))
    return set()


def faults(root: Path, wings: dict[str, tuple[str, ...]]) -> Iterator[str]:
    """Yield what breaks the rules, one sentence each."""
    for folder in wings:
        for path in [root / folder, *(p for p in (root / folder).rglob("*") if p.is_dir())]:
            if not (path / "__init__.py").is_file():
                continue
            entries = entries_of(path)
            if len(entries) > MOST_ENTRIES:
                yield f"{path.relative_to(root)} holds {len(entries)} entries, over {MOST_ENTRIES}"
        unknown = {p.removesuffix(".py") for p in entries_of(root / folder) if p != "__init__.py"}
        if unknown - set(wings[folder]):
            yield f"{folder} holds {', '.join(sorted(unknown - set(wings[folder])))}, which WINGS lacks"
            continue
        yield from filter(None, (line.fault(wings) for line in imports(root, folder)))


def entries_of(folder: Path) -> list[str]:
    """Return the modules, C files and wings of a folder."""
    kept = (p for p in folder.iterdir() if p.suffix in (".py", ".c") or (p / "__init__.py").is_file())
    return sorted(path.name for path in kept)


Modules = dict[tuple[str, ...], set[tuple[str, ...]]]


def modules(root: Path, folders: Iterable[str]) -> Modules:
    """Return which modules of the folders each of their modules imports, seen through the faces.

    A face holds nothing: what is imported from it counts as imported from the module that defines it.
    """
    graph: Modules = {}
    for folder in folders:
        for path in sorted((root / folder).rglob("*.py")):
            source = path.relative_to(root).with_suffix("").parts
            if source[-1] != "__init__":
                graph[source] = {
                    target
                    for base, name in imported_names(path, source)
                    if (target := defining(root, base, name)) is not None and target != source
                }
    return {source: targets & set(graph) for source, targets in graph.items()}


def imported_names(path: Path, source: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield package or module, and name, of everything of ours that a file imports."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom) and node.level:
            package = source[: len(source) - node.level]
            base = (*package, *(node.module or "").split(".")) if node.module else package
            yield from ((base, alias.name) for alias in node.names)


def defining(root: Path, base: tuple[str, ...], name: str) -> tuple[str, ...] | None:
    """Return the module behind `from base import name`, or None where that is nothing of a module."""
    face = root.joinpath(*base, "__init__.py")
    if not face.is_file():
        return base
    for inner, exported in imported_names(face, (*base, "__init__")):
        if exported == name and inner != base:
            return defining(root, inner, name)
    module = root.joinpath(*base, name)
    return (*base, name) if is_module(module) and not module.is_dir() else None


def depth(graph: Modules) -> int:
    """Return the number of modules in the longest chain of imports; fails on a circle."""
    open_: list[tuple[str, ...]] = []

    @cache
    def below(module: tuple[str, ...]) -> int:
        assert module not in open_, f"an import circle through {'/'.join(module)}"
        open_.append(module)
        longest = 1 + max((below(other) for other in graph[module]), default=0)
        open_.remove(module)
        return longest

    return max(below(module) for module in graph)


def test_wings_import_downwards_through_faces() -> None:
    assert not list(faults(ROOT, WINGS))


@pytest.mark.parametrize("folder", WINGS)
def test_no_import_circle(folder: str) -> None:
    assert depth(modules(ROOT, [folder])) > 1


def test_no_import_circle_across_folders() -> None:
    assert depth(modules(ROOT, WINGS)) > 1


def table() -> list[list[str]]:
    """Return for each folder wings, files, import depth, most entries, longest file and function."""
    rows, below = [], list[str]()
    for folder, wings in WINGS.items():
        below.append(folder)
        files = sorted((ROOT / folder).rglob("*.py"))
        packages = [path.parent for path in files if path.name == "__init__.py"]
        lengths = [(len(path.read_text(encoding="utf-8").splitlines()), path.stem) for path in files]
        functions = [
            ((node.end_lineno or 0) - node.body[0].lineno + 1, node.name)
            for path in files
            for node in ast.walk(tree(path))
            if isinstance(node, ast.FunctionDef)
        ]
        most = max((len(entries_of(package)), package.name) for package in packages)
        rows.append(
            [
                *(folder, str(len(wings)), str(len(files)), str(depth(modules(ROOT, [folder])))),
                str(depth(modules(ROOT, below))),
                *(f"{number} ({name})" for number, name in (most, max(lengths), max(functions))),
            ]
        )
    return rows


HEADER = [
    *("folder", "wings", "files", "depth", "with those before it"),
    *("most entries", "longest file", "longest function"),
]


def test_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    rows = table()
    with capsys.disabled():
        widths = [max(len(row[i]) for row in [HEADER, *rows]) for i in range(len(HEADER))]
        print()
        for row in [HEADER, *rows]:
            print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)))
    assert [row[0] for row in rows] == list(WINGS)


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A small house that keeps the rules."""
    for name, text in {
        "low/__init__.py": "",
        "low/ground.py": "x = 1\n",
        "low/wing/__init__.py": 'from .inner import y\n__all__ = ["y"]\n',
        "low/wing/inner.py": "from ..ground import x\ny = x\n",
        "low/roof.py": "from .wing import y\nz = y\n",
        "high/__init__.py": "",
        "high/top.py": "from ..low.wing import y\nw = y\n",
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return tmp_path


RULES = {"low": ("ground", "wing", "roof"), "high": ("top",)}


def test_a_house_that_keeps_the_rules(house: Path) -> None:
    assert list(faults(house, RULES)) == []


@pytest.mark.parametrize(
    ("file", "line", "said"),
    [
        ("low/ground.py", "from .roof import z", "low/ground.py:1 imports low.roof, upwards"),
        (
            "low/roof.py",
            "from .wing.inner import y",
            "imports low.wing.inner, past the face of low.wing",
        ),
        ("high/top.py", "from ..low.wing.inner import y", "past the face of low.wing"),
        ("low/wing/inner.py", "from .. import ground", "low/wing/inner.py:1"),
        ("low/roof.py", "from . import missing", "the face of its own folder"),
    ],
)
def test_a_broken_rule_is_named(house: Path, file: str, line: str, said: str) -> None:
    (house / file).write_text(f"{line}\n", encoding="utf-8")
    found = list(faults(house, RULES))
    if line == "from .. import ground":  # a module of the folder itself: its own face
        assert found == []
    else:
        assert len(found) == 1
        assert said in found[0]


def test_a_full_folder_and_an_unknown_wing_are_named(house: Path) -> None:
    for i in range(20):
        (house / "low" / "wing" / f"more_{i}.py").write_text("", encoding="utf-8")
    (house / "high" / "new.py").write_text("", encoding="utf-8")
    assert list(faults(house, RULES)) == [
        "low/wing holds 22 entries, over 13",
        "high holds new, which WINGS lacks",
    ]


def test_an_import_circle_is_named(house: Path) -> None:
    (house / "low" / "ground.py").write_text("from .roof import z\nx = z\n", encoding="utf-8")
    with pytest.raises(AssertionError, match="an import circle through low"):
        depth(modules(house, ["low"]))
