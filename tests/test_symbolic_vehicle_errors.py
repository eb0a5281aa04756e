"""A vehicle file that breaks a rule: one sentence that names the fault, the rule and the way out."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from stationkeep.symbolic import InputError, Vehicle

Check = Callable[[BaseException], str]
FILE = resources.files("stationkeep.symbolic.underwater").joinpath("vehicles", "bluerov2-heavy.toml")
TEXT = FILE.read_text(encoding="utf-8")
ALLOCATION = np.array(tomllib.loads(TEXT)["thrusters"]["allocation"])
CENTER = "center_of_gravity = [0.0, 0.0, 0.0]"
LIMITS = "limits = [-39.9, 51.5]"
INERTIA = "inertia = [[0.26, 0.0, 0.0], [0.0, 0.23, 0.0], [0.0, 0.0, 0.37]]"
LINEAR = [13.7, 0.0, 33.0, 0.0, 0.8, 0.0]
SOME_SWAY = [13.7, 1.0, 33.0, 0.0, 0.8, 0.0]
QUADRATIC = [141.0, 217.0, 190.0, 1.19, 0.47, 1.5]


def edited(old: str, new: str) -> str:
    """Return the shipped file with one passage replaced."""
    assert TEXT.count(old) == 1, old
    return TEXT.replace(old, new)


def refusal(path: Path, content: str | bytes, check: Check) -> str:
    """Return what the user reads about a file, without the part that names the file."""
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as caught:
        Vehicle.load(path)
    text = check(caught.value)
    assert str(path) in text
    return text.replace(str(path), "FILE")


def full(diagonal: list[float], row: int, column: int, value: float) -> str:
    """Return a 6x6 matrix in TOML: a diagonal and one more entry."""
    matrix = np.diag(diagonal)
    matrix[row, column] = value
    return str(matrix.tolist())


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("gravity = 9.82", "gravty = 9.82", ["'gravty'", "did you mean 'gravity'"]),
        ("\nmass = 13.5", "\nmas = 13.5", ["'mas'", "did you mean 'mass'"]),
        ("\nlimits =", "\nlimit =", ["limit'", "did you mean", "'limits'"]),
        ("\nlimits =", "\nlimts = 1\nlimits =", ["thrusters.limts", "did you mean 'limits'"]),
        ("\nmass = 13.5", "", ["'mass'", "required"]),
        (f"\n{LIMITS}", "", ["limits'", "required"]),
    ],
)
def test_keys(old: str, new: str, words: list[str], tmp_path: Path, one_sentence: Check) -> None:
    """An unknown key names the nearest known one, also where the known one is then missing."""
    text = refusal(tmp_path / "v.toml", edited(old, new), one_sentence)
    assert all(word in text for word in words), text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (CENTER, "center_of_gravity = [0.0, 0.1]", ["center_of_gravity", "0.1", "3"]),
        (CENTER, "center_of_gravity = [0, 0, 0, 0]", ["center_of_gravity", "3"]),
        (CENTER, "center_of_gravity = 0.5", ["center_of_gravity", "0.5"]),
        (INERTIA, "inertia = [[1.0, 0.0], [0.0, 1.0]]", ["inertia", "3x3"]),
        (INERTIA, "inertia = [0.26, 0.23, 0.37]", ["inertia", "3x3"]),
        (INERTIA, "inertia = [[1.0, 0.0, 0.0], [1.0], [1.0]]", ["inertia"]),
        ("    [0.0, 0.0, 0.0, 0.0, 0.0, 0.222],\n", "", ["added_mass"]),
        (str(LINEAR), str(LINEAR[:5]), ["linear_damping", "6 entries", "6x6"]),
        (str(LINEAR), str([LINEAR] * 3), ["linear_damping", "6 entries", "6x6"]),
        (
            str(QUADRATIC),
            "[[1.0], [1.0, 2.0], [1.0], [1.0], [1.0], [1.0]]",
            ["quadratic_damping", "6 entries", "6x6"],
        ),
        (LIMITS, "limits = [-39.9]", ["limits", "-39.9"]),
        (LIMITS, "limits = [-39.9, 0.0, 51.5]", ["limits"]),
    ],
)
def test_shapes(old: str, new: str, words: list[str], tmp_path: Path, one_sentence: Check) -> None:
    """Which key, and what shape it must have."""
    text = refusal(tmp_path / "v.toml", edited(old, new), one_sentence)
    assert all(word in text for word in words), text


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "1e999"])
@pytest.mark.parametrize(
    ("before", "old", "key"),
    [
        ("\nmass = ", "13.5", "mass"),
        ("[", "6.36", "added_mass"),
        ("[[", "0.26", "inertia"),
        ("[", "13.7", "linear_damping"),
        ("[", "141.0", "quadratic_damping"),
        ("limits = [", "-39.9", "limits"),
        ("[", "-0.1888", "allocation"),
    ],
)
def test_numbers_must_be_finite(
    number: str, before: str, old: str, key: str, tmp_path: Path, one_sentence: Check
) -> None:
    """TOML knows nan and inf, and 1e999 becomes inf."""
    text = refusal(tmp_path / "v.toml", edited(before + old, before + number), one_sentence)
    assert key in text
    assert "finite" in text
    assert f"is {'inf' if number == '1e999' else number}," in text


def test_full_damping_must_be_finite(tmp_path: Path, one_sentence: Check) -> None:
    """The 6x6 form too; the number itself is named, not the row that holds it."""
    matrix = full(LINEAR, 0, 1, 5.0).replace("5.0", "nan")
    text = refusal(tmp_path / "v.toml", edited(str(LINEAR), matrix), one_sentence)
    assert "linear_damping" in text
    assert "finite" in text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("\nmass = 13.5", "\nmass = -13.5", ["'mass' is -13.5", "greater than 0"]),
        ("\nmass = 13.5", '\nmass = "13.5 kg"', ["'mass' is '13.5 kg'", "number"]),
        ("\nmass = 13.5", "\nmass = true", ["'mass' is True", "number"]),
        ("gravity = 9.82", "gravity = 0.0", ["'gravity' is 0.0", "greater than 0"]),
        ('units = "SI"', 'units = "imperial"', ["'units' is 'imperial'", "'SI'"]),
        (str(LINEAR), '"large"', ["linear_damping", "'large'"]),
        ("[13.7", '["a"', ["linear_damping", "'a'", "number"]),
        (LIMITS, "limits = [39.9, 51.5]", ["[39.9, 51.5]", "[negative, positive]"]),
        (LIMITS, "limits = [-39.9, -1.0]", ["[negative, positive]", "N"]),
    ],
)
def test_values(old: str, new: str, words: list[str], tmp_path: Path, one_sentence: Check) -> None:
    """What was given and what is required."""
    text = refusal(tmp_path / "v.toml", edited(old, new), one_sentence)
    assert all(word in text for word in words), text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[6.36, 0.0", "[6.36, 0.5", ["added_mass", "symmetric", "0.5", "mean"]),
        ("[[0.26, 0.0", "[[0.26, 0.1", ["inertia", "symmetric", "0.1"]),
        ("[[0.26", "[[-0.26", ["rigid-body inertia", "positive definite", "-0.26"]),
        ("[6.36", "[-20.0", ["added_mass", "-20", "SNAME", "-(X_udot"]),
        (
            CENTER,
            "center_of_gravity = [0.0, 0.0, 0.5]",  # m z^2 = 3.4 kg m^2 exceeds the inertia about CO
            ["rigid-body inertia", "positive definite", "center_of_gravity"],
        ),
        ("[13.7", "[-13.7", ["linear_damping", "dissipative"]),
        (str(LINEAR), full(SOME_SWAY, 0, 1, 8.0), ["linear_damping", "dissipative"]),  # 13.7 < (8/2)^2
        ("[141.0", "[-141.0", ["quadratic_damping", "dissipative"]),
    ],
)
def test_physics(old: str, new: str, words: list[str], tmp_path: Path, one_sentence: Check) -> None:
    """Symmetry, positive inertia and dissipation, with the numbers that break them."""
    text = refusal(tmp_path / "v.toml", edited(old, new), one_sentence)
    assert all(word in text for word in words), text


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (str(LINEAR), full(SOME_SWAY, 0, 1, 7.0)),  # 13.7 * 1 > (7/2)^2
        ("[6.36, 0.0", "[6.36, 1e-9"),
        (str(LINEAR), "[0, 0, 0, 0, 0, 0]"),
    ],
)
def test_admissible_neighbours(old: str, new: str, tmp_path: Path) -> None:
    """Just inside each rule: full but dissipative damping, none at all, rounded symmetry."""
    path = tmp_path / "v.toml"
    path.write_text(edited(old, new), encoding="utf-8")
    assert Vehicle.load(path).mass == 13.5


@pytest.mark.parametrize(("row", "column"), [(0, 1), (4, 3), (0, 4), (3, 0), (5, 2)])
def test_full_quadratic_damping(row: int, column: int, tmp_path: Path, one_sentence: Check) -> None:
    """One entry c off the diagonal (a, b): a |u|^3 + c u |v| v + b |v|^3 >= 0 for every u and v.

    With u = -1 the least over v is a - 4 c^3 / (27 b^2), at v = 2 c / (3 b): c^3 <= 27 a b^2 / 4. The
    rule must not depend on the units, so forces and moments are mixed here.
    """
    a, b = QUADRATIC[row], QUADRATIC[column]
    largest = (27.0 * a * b**2 / 4.0) ** (1.0 / 3.0)
    path = tmp_path / "v.toml"
    path.write_text(edited(str(QUADRATIC), full(QUADRATIC, row, column, 0.99 * largest)), "utf-8")
    assert Vehicle.load(path).D_quadratic[row, column] > 0.0
    excessive = edited(str(QUADRATIC), full(QUADRATIC, row, column, 1.05 * largest))
    text = refusal(path, excessive, one_sentence)
    assert "quadratic_damping" in text
    assert "dissipative" in text


@pytest.mark.parametrize("dropped", [[6, 7], [4], [0, 1]])
def test_allocation_rank(dropped: list[int], tmp_path: Path, one_sentence: Check) -> None:
    """The six-thruster vehicle has rank 5; losing one vertical of eight leaves rank 6."""
    rows = np.delete(ALLOCATION, dropped, axis=1)
    head = TEXT.partition("allocation = ")[0]
    content = f"{head}allocation = {rows.tolist()}\nlimits = [-39.9, 51.5]\n"
    rank = np.linalg.matrix_rank(rows, tol=1e-6)
    if rank == 6:
        path = tmp_path / "v.toml"
        path.write_text(content, encoding="utf-8")
        assert Vehicle.load(path).thrusters is not None
    else:
        text = refusal(tmp_path / "v.toml", content, one_sentence)
        assert all(word in text for word in ["allocation", f"rank {rank}", "needs rank 6"]), text


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (TEXT[:700], ["not valid TOML", "restore"]),
        (TEXT[:300], ["not valid TOML", "restore"]),
        (b"\x7fELF\x02\x01\xff\xfe\x00", ["not UTF-8"]),
        ("", ["'name'", "required"]),
        (TEXT.encode("utf-16"), ["not UTF-8"]),
    ],
    ids=["truncated", "truncated-in-a-string", "binary", "empty", "utf-16"],
)
def test_damaged_file(
    content: str | bytes, words: list[str], tmp_path: Path, one_sentence: Check
) -> None:
    """The file is named, and what is wrong with it as a whole."""
    text = refusal(tmp_path / "v.toml", content, one_sentence)
    assert all(word in text for word in words), text


def test_paths(tmp_path: Path, one_sentence: Check) -> None:
    """A missing file and a directory, as a Path and as text."""
    missing = tmp_path / "missing.toml"
    for path, words in ((missing, "no file"), (tmp_path, "directory")):
        for given in (path, str(path)):
            with pytest.raises(InputError) as caught:
                Vehicle.load(given)
            text = one_sentence(caught.value)
            assert str(path) in text
            assert words in text


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("bluerov2_heavy", "bluerov2-heavy"), ("RexROV", "rexrov"), ("bluerov2-boyant", "buoyant")],
)
def test_unknown_vehicle(name: str, nearest: str, one_sentence: Check) -> None:
    """The nearest shipped vehicle is named, and that a path may be given."""
    with pytest.raises(InputError) as caught:
        Vehicle.load(name)
    text = one_sentence(caught.value)
    assert all(word in text for word in [f"'{name}'", "did you mean", nearest, ".toml"]), text


def test_vehicle_like_no_other(one_sentence: Check) -> None:
    """Without a similar name all of them are listed."""
    with pytest.raises(InputError) as caught:
        Vehicle.load("xyz")
    shipped = ("bluerov2-heavy", "bluerov2-heavy-buoyant", "rexrov")
    assert all(name in one_sentence(caught.value) for name in shipped)
