"""The architecture: who imports whom, sizes, names, docstrings, and what is shipped."""

from __future__ import annotations

import ast
import re
import socket
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib import import_module, resources
from pathlib import Path

import pytest
from stationkeep.comparison import Scenario
from stationkeep.symbolic import Vehicle
from stationkeep.symbolic.toml import shipped_names

ROOT = Path(__file__).resolve().parents[1]
MAY_IMPORT = {
    "symbolic": set[str](),
    "online": {"symbolic"},
    "offline": {"symbolic"},
    "comparison": {"symbolic", "online", "offline"},
    "cli": {"symbolic", "online", "offline", "comparison"},
}
SOURCES = [path for folder in MAY_IMPORT for path in sorted((ROOT / folder).rglob("*.py"))]
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
# the file that may import what only an extra installs
ADAPTERS = {"control": "comparison/adapters/control.py", "gymnasium": "comparison/adapters/gym.py"}


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def imported(path: Path) -> Iterator[str]:
    """Yield the absolute name of every module that a source file imports, wherever it does."""
    package = ["stationkeep", *path.relative_to(ROOT).parent.parts]
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = [*base, *(node.module or "").split(".")] if node.module else base
            yield ".".join(module)
            yield from (".".join([*module, alias.name]) for alias in node.names)


def functions(path: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    for node in ast.walk(tree(path)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Return the number of lines of a function's body without its docstring."""
    body = function.body
    if ast.get_docstring(function) is not None:
        body = body[1:]
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def public(node: ast.Module | ast.ClassDef, prefix: str) -> Iterator[tuple[str, ast.AST]]:
    for child in node.body:
        if isinstance(child, DEFINITIONS) and not child.name.startswith("_"):
            yield f"{prefix}.{child.name}", child
            if isinstance(child, ast.ClassDef):
                yield from public(child, f"{prefix}.{child.name}")


def test_the_sources_are_where_the_design_says() -> None:
    for folder in MAY_IMPORT:
        assert (ROOT / folder / "__init__.py").is_file()
    assert len(SOURCES) > 30


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_imports_follow_the_table(path: Path) -> None:
    folder = path.relative_to(ROOT).parts[0]
    allowed = MAY_IMPORT[folder] | {folder}
    for module in imported(path):
        first, _, rest = module.partition(".")
        assert first not in MAY_IMPORT, f"{module} is not relative to stationkeep"
        if first == "stationkeep" and rest:
            assert rest.split(".")[0] in allowed, f"{name_of(path)} imports {module}"


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_our_own_modules_are_imported_relatively(path: Path) -> None:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            assert not [a.name for a in node.names if a.name.split(".")[0] == "stationkeep"]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            assert (node.module or "").split(".")[0] != "stationkeep"


def test_every_import_is_a_declared_dependency() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {re.split(r"[^A-Za-z0-9_-]", line)[0] for line in project["dependencies"]}
    used = {module.split(".")[0] for path in SOURCES for module in imported(path)}
    foreign = used - set(sys.stdlib_module_names) - {"stationkeep"}
    assert foreign - declared == set(ADAPTERS)
    assert declared <= foreign
    extras = project["optional-dependencies"]
    assert [re.split(r"\W", line)[0] for name in ("control", "gym") for line in extras[name]] == [
        *ADAPTERS
    ]
    assert {*extras["control"], *extras["gym"]} <= set(extras["test"])


def test_what_only_an_extra_installs_is_imported_by_its_adapter_alone() -> None:
    for path in SOURCES:
        packages = {module.split(".")[0] for module in imported(path)}
        for package in packages & set(ADAPTERS):
            assert name_of(path) == ADAPTERS[package]
        adapters = {place.removesuffix(".py").replace("/", ".") for place in ADAPTERS.values()}
        names = {module.removeprefix("stationkeep.") for module in imported(path)}
        assert not names & adapters, f"{name_of(path)} imports an adapter"


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_files_have_at_most_300_lines(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 300


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_functions_have_at_most_40_lines(path: Path) -> None:
    long = {f.name: body_lines(f) for f in functions(path) if body_lines(f) > 40}
    assert not long


def test_modules_are_named_after_what_they_hold() -> None:
    vague = {"utils", "util", "helpers", "helper", "misc", "common", "tools"}
    places = [*SOURCES, *(ROOT / "tests").glob("*.py")]
    assert not [name_of(path) for path in places if path.stem in vague]


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_everything_public_has_a_docstring(path: Path) -> None:
    module = tree(path)
    assert ast.get_docstring(module), name_of(path)
    bare = [name for name, node in public(module, path.stem) if not ast.get_docstring(node)]  # type: ignore[arg-type]
    assert not bare


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_everything_is_annotated(path: Path) -> None:
    for function in functions(path):
        arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
        bare = [a.arg for a in arguments if a.annotation is None and a.arg not in ("self", "cls")]
        assert not bare, f"{function.name}({', '.join(bare)})"
        assert function.returns is not None, function.name


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_exported_names_exist_and_the_types_are_shipped(folder: str) -> None:
    package = import_module(f"stationkeep.{folder}")
    for name in getattr(package, "__all__", []):
        assert hasattr(package, name)
    assert resources.files(package).joinpath("py.typed").is_file()


def test_shipped_vehicles_load() -> None:
    names = shipped_names("stationkeep.symbolic.underwater", "vehicles")
    assert {"bluerov2-heavy", "bluerov2-heavy-buoyant", "rexrov"} <= set(names)
    for name in names:
        assert Vehicle.load(name).source


def test_shipped_scenarios_load() -> None:
    assert "bluerov2-heavy" in Scenario.shipped()
    for name in Scenario.shipped():
        scenario = Scenario.load(name)
        assert Vehicle.load(scenario.vehicle).mass > 0.0


def test_package_data_covers_what_is_read_at_run_time() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    data = project["tool"]["setuptools"]["package-data"]
    packages = {path.parent for path in SOURCES}
    for folder in MAY_IMPORT:
        for path in (ROOT / folder).rglob("*"):
            if path.is_dir() or path.suffix in (".py", ".pyc"):
                continue
            package = next(parent for parent in path.parents if parent in packages)
            name = ".".join(["stationkeep", *package.relative_to(ROOT).parts])
            relative = path.relative_to(package)
            patterns = data.get(name, [])
            assert any(relative.match(pattern) for pattern in patterns), name_of(path)


def test_every_package_is_shipped() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    shipped = set(project["tool"]["setuptools"]["packages"])
    there = {".".join(["stationkeep", *path.parent.relative_to(ROOT).parts]) for path in SOURCES}
    assert shipped == there | {"stationkeep"}  # the names at the top, in api/


def written_files() -> list[Path]:
    """Return the text files of the project, without what tools leave behind."""
    folders = [*MAY_IMPORT, "api", "tests", "docs", "benchmarks", "examples", ".ci", ".github"]
    # in a second work tree `.git` is a file that holds a path
    found = [path for path in ROOT.iterdir() if path.is_file() and path.name != ".git"]
    found += [path for folder in folders for path in (ROOT / folder).rglob("*")]
    kinds = (".py", ".toml", ".md", ".yml", ".yaml", ".cfg", ".txt", ".sh", ".html", "")
    return [p for p in found if p.is_file() and p.suffix in kinds and "__pycache__" not in p.parts]


def test_no_absolute_paths_and_no_host_names() -> None:
    folders = "home|root|work|Users|mnt|media|tmp|var|scratch"
    path_of_one_machine = re.compile(rf"(?<![\w.:/])/(?:{folders})/\w|[A-Z]:\\\\?Users")
    host = socket.gethostname()
    for path in written_files():
        text = path.read_text(encoding="utf-8", errors="replace")
        assert not path_of_one_machine.search(text), name_of(path)
        if len(host) > 5 and host != "localhost":
            assert host not in text, name_of(path)
