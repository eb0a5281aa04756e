"""Initial states that can't be used, from the command line and from .npy and CSV files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from .commands import QUICK, call, files_in, sets

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "user"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def write_npy(value: object) -> Callable[[Path], None]:
    return lambda path: np.save(path, np.asarray(value))


def write_text(text: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_text(text, encoding="utf-8")

    return write


def write_bytes(content: bytes) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_bytes(content)

    return write


def write_half(path: Path) -> None:
    np.save(path, np.zeros((3, 12)))
    path.write_bytes(path.read_bytes()[:150])


ROW = ",".join(["0.1"] * 12) + "\n"
NAN_ROW = ",".join(["0.1"] * 11) + ",nan\n"
STATES: list[tuple[str, Callable[[Path], None], list[str]]] = [
    ("half.npy", write_half, ["rows of 12"]),
    ("empty.npy", write_bytes(b""), ["rows of 12"]),
    ("noise.npy", write_bytes(bytes(range(256))), ["rows of 12"]),
    ("columns.npy", write_npy(np.zeros((2, 11))), ["(2, 11)", "rows of 12"]),
    ("cube.npy", write_npy(np.zeros((1, 2, 12))), ["(1, 2, 12)", "rows of 12"]),
    ("number.npy", write_npy(1.0), ["rows of 12"]),
    ("none.npy", write_npy(np.zeros((0, 12))), ["rows of 12"]),
    ("words.npy", write_npy([["a"] * 12]), ["rows of 12"]),
    ("complex.npy", write_npy(np.ones((1, 12)) * 0.1j), ["rows of 12"]),
    ("nan.npy", write_npy([[0.1] * 12, [0.1] * 11 + [np.nan]]), ["finite"]),
    ("infinite.npy", write_npy([[np.inf] * 12]), ["finite"]),
    ("steep.npy", write_npy([[0.0] * 4 + [1.6] + [0.0] * 7]), ["pitch", "90 deg"]),
    ("ragged.csv", write_text("1,2,3\n4,5\n"), ["12"]),
    ("empty.csv", write_text(""), ["rows of 12"]),
    ("header.csv", write_text("x,y,z\n" + ROW), ["rows of 12"]),
    ("spaces.csv", write_text(ROW.replace(",", " ", 3)), ["line 1", "rows of 12"]),
    ("cut.csv", write_text(ROW + ROW[:-6]), ["12"]),
    ("nan.csv", write_text(ROW + NAN_ROW), ["finite"]),
    ("noise.csv", write_bytes(bytes(range(128, 256))), ["UTF-8", "states"]),
]


@pytest.mark.parametrize(("name", "write", "words"), STATES, ids=[case[0] for case in STATES])
def test_states_files(
    name: str,
    write: Callable[[Path], None],
    words: list[str],
    user_folder: Path,
    capsys: Capture,
) -> None:
    write(user_folder / name)
    answer = call(capsys, "offline", "--quiet", "--json", "--states", name, *sets(*QUICK))
    assert answer.code == 2
    assert answer.out == ""
    text = answer.sentence()
    for word in (name, *words):
        assert word in text, text
    assert files_in(user_folder) == [name]


def test_states_file_that_is_missing_or_a_folder(user_folder: Path, capsys: Capture) -> None:
    (user_folder / "folder.npy").mkdir()
    for name in ("none.npy", "none.csv", "folder.npy", "."):
        answer = call(capsys, "offline", "--quiet", "--states", name, *sets(*QUICK))
        assert answer.code == 2
        assert f"'{name}'" in answer.sentence()
    assert files_in(user_folder) == []


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ("nan,0,0,0,0,0,0,0,0,0,0,0", ["finite", "NaN"]),
        ("0,0,0,0,0,0,0,0,0,0,0,-inf", ["finite"]),
        ("1,2,3", ["12 numbers", "3"]),
        ("a,b,c", ["a,b,c", "12 numbers"]),
        ("", ["12 numbers"]),
        ("0,0,0,0,1.5707963267948966,0,0,0,0,0,0,0", ["90.0 deg", "inside ±90 deg"]),
    ],
)
def test_states_of_the_command_line(state: str, words: list[str], capsys: Capture) -> None:
    answer = call(capsys, "offline", "--quiet", "--state", state, *sets(*QUICK))
    assert answer.code == 2
    text = answer.sentence()
    for word in words:
        assert word in text, text
