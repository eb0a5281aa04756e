"""Scenario files, weights and bases of a user that are missing, truncated or of the wrong kind."""

from __future__ import annotations

from pathlib import Path

import pytest
from stationkeep.comparison.records import runs

from .commands import QUICK, call, files_in, sets
from .games import quick_scenario

Capture = pytest.CaptureFixture[str]
SHORT = sets(*QUICK, "simulation.duration=0.3")


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "user"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the record of a short run with the quadratic basis."""
    path = tmp_path_factory.mktemp("finished") / "learned.nc"
    runs.online_record(quick_scenario("simulation.duration=0.3"), path)
    return path


def truncated(source: Path, target: Path, share: float) -> Path:
    whole = source.read_bytes()
    target.write_bytes(whole[: int(share * len(whole))])
    return target


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["'vehicle'", "missing"]),
        (b'vehicle = "bluerov2-heavy"\n[ga', ["not valid TOML"]),
        (b'vehicle = "bluerov2-heavy"\n', ["'game'", "missing"]),
        (b"\x7fELF\x02\x01\x01\x00\x00\xff\xfe\xfd", ["TOML"]),
        (b"vehicle = \xff\xfe\xfd", ["not UTF-8"]),
    ],
)
def test_scenario_files(content: bytes, words: list[str], user_folder: Path, capsys: Capture) -> None:
    (user_folder / "mine.toml").write_bytes(content)
    for command in ("online", "compare"):
        answer = call(capsys, command, "mine.toml", "--quiet")
        assert answer.code == 2
        text = answer.sentence()
        for word in ("mine.toml", *words):
            assert word in text, text
    assert files_in(user_folder) == ["mine.toml"]


def test_a_folder_is_no_scenario(user_folder: Path, capsys: Capture) -> None:
    (user_folder / "mine.toml").mkdir()
    answer = call(capsys, "check", "mine.toml")
    assert answer.code == 2
    assert "mine.toml" in answer.sentence()


def test_weights_files(record: Path, user_folder: Path, capsys: Capture) -> None:
    truncated(record, user_folder / "cut.nc", 0.4)
    truncated(record, user_folder / "late.nc", 0.95)
    (user_folder / "noise.nc").write_bytes(bytes(range(256)) * 20)
    (user_folder / "folder.nc").mkdir()
    before = files_in(user_folder)
    for name in ("cut.nc", "late.nc", "noise.nc", "folder.nc", "none.nc"):
        answer = call(capsys, "online", "--quiet", *SHORT, "--set", f"learner.weights={name}")
        assert answer.code == 2
        text = answer.sentence()
        assert name in text, text
        assert "record" in text
        assert "site-packages" not in text
        assert "comparison" not in text, "a path inside the package means nothing to a user"
    assert files_in(user_folder) == before


def test_weights_of_another_basis(record: Path, user_folder: Path, capsys: Capture) -> None:
    (user_folder / "small.py").write_text(
        "import casadi\nfrom stationkeep.symbolic import quadratic\n"
        "def more(x):\n    return casadi.vertcat(quadratic(x), x[0] ** 4)\n",
        encoding="utf-8",
    )
    settings = sets("basis.name=small.py:more", f"learner.weights='{record}'")
    answer = call(capsys, "online", "--quiet", *SHORT, *settings)
    assert answer.code == 2
    text = answer.sentence()
    for word in ("78 weights", "has 79", "same basis"):
        assert word in text


BASES = [
    ("def f(x: return", "f", ["mine.py", "SyntaxError"]),
    ("import nowhere", "f", ["mine.py", "nowhere"]),
    ("raise ValueError('two\\nlines')", "f", ["mine.py", "two"]),
    ("def f(x): return 1 / 0", "f", ["mine.py:f", "division by zero"]),
    ("def f(x): return x[100]", "f", ["mine.py:f"]),
    ("def f(): return 1", "f", ["mine.py:f", "argument"]),
    ("def f(x): return 3", "f", ["mine.py:f", "casadi.SX"]),
    ("def f(x): return [x[0] ** 2]", "f", ["mine.py:f", "casadi.SX"]),
    ("def f(x): return x[0]", "f", ["mine.py:f", "sigma'(0) must be 0"]),
    ("def f(x): return 1 + x[0] ** 2", "f", ["mine.py:f", "sigma(0) must be 0"]),
    ("def f(x): return x[0] ** 2", "f", ["mine.py:f", "Riccati", "quadratic(x)"]),
    ("f = 3", "f", ["mine.py", "no function 'f'"]),
    ("def f(x): return x", "g", ["mine.py", "no function 'g'"]),
]


@pytest.mark.parametrize(("code", "function", "words"), BASES, ids=[case[0] for case in BASES])
def test_bases_of_a_user(
    code: str, function: str, words: list[str], user_folder: Path, capsys: Capture
) -> None:
    (user_folder / "mine.py").write_text(code, encoding="utf-8")
    name = f"basis.name=mine.py:{function}"
    answer = call(capsys, "check", "--quiet", "--set", name)
    assert answer.code == 2
    text = answer.sentence()
    for word in words:
        assert word in text, text


def test_a_basis_file_that_is_missing(capsys: Capture) -> None:
    answer = call(capsys, "check", "--quiet", "--set", "basis.name=none.py:f")
    assert answer.code == 2
    text = answer.sentence()
    assert "none.py" in text
    assert "file.py:function" in text
    assert "comparison" not in text, "a path inside the package means nothing to a user"
