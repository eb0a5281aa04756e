"""Files of users: what is meant without doubt is read, else the line and the cell are named."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stationkeep.cli.main import main
from stationkeep.cli.states import read_states
from stationkeep.comparison import Scenario
from stationkeep.comparison.scenario.overrides import parse_value, parse_values
from stationkeep.symbolic import InputError, Problem, two_state_game
from stationkeep.symbolic.toml import LARGEST, read_toml

CASES = Path(__file__).parent / "cases"
Check = Callable[[BaseException], str]
STATES = np.array([[0.5, -0.25], [0.125, 0.0]])


@pytest.fixture(scope="module")
def problem() -> Problem:
    return two_state_game()


@pytest.mark.parametrize(
    "text",
    [
        "0.5,-0.25\n0.125,0",
        "\ufeff0.5,-0.25\r\n0.125,0\r\n",
        "x_1,x_2\n0.5,-0.25\n0.125,0\n",
        '"x_1","x_2"\n0.5,-0.25\n0.125,0\n',
        "0.5,-0.25,\n0.125,0,\n",
        "# two states\n\n0.5, -0.25  # the first\n0.125, 0\n",
        "0,5;-0,25\n0,125;0\n",
        "0,5\t-0,25\n0,125\t0\n",
        "0.5 -0.25\n.125   0\n",
        "5e-1,-2.5E-1\n+1.25e-1,-0\n",
    ],
)
def test_tables_of_states(text: str, tmp_path: Path, problem: Problem) -> None:
    assert list(problem.state_names) == ["x_1", "x_2"]
    path = tmp_path / "states.csv"
    path.write_bytes(text.encode())
    np.testing.assert_array_equal(read_states(path, problem), STATES)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0.5,-0.25\n0.125,north\n", ["line 2, cell 2", "'north'", "number"]),
        ("0.5,-0.25\n0.125\n", ["line 2", "1 cells", "2 numbers"]),
        ("0.5,-0.25,1\n", ["line 1", "3 cells"]),
        ("0.5,,-0.25\n", ["line 1", "3 cells"]),
        ("a,b\n0.5,0.5\n", ["line 1, cell 1", "'a'"]),
        ("0.5,-0.25\nx_1,x_2\n", ["line 2, cell 1", "'x_1'"]),
        ("0,5,0,25\n", ["line 1", "4 cells"]),
        ("nan,0\n", ["row 1", "nan"]),
        ("1e999,0\n", ["row 1", "inf"]),
        ("", ["no numbers"]),
        ("# nothing\n", ["no numbers"]),
        ("\x00\x01", ["line 1"]),
    ],
)
def test_tables_that_are_none(
    text: str, words: list[str], tmp_path: Path, problem: Problem, one_sentence: Check
) -> None:
    path = tmp_path / "states.csv"
    path.write_bytes(text.encode())
    with pytest.raises(InputError) as caught:
        read_states(path, problem)
    assert all(word in one_sentence(caught.value) for word in words), caught.value


def npy(shape: str, order: str = "<f8") -> bytes:
    head = f"{{'descr': {order!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head


@pytest.mark.parametrize(
    "content",
    [
        npy("(1000000000000, 2)"),
        npy("(-1, 2)"),
        npy("'two'"),
        npy("(2, 2)", "|O"),
        npy("(2, 2)", "nonsense"),
        npy("(2,"),
        npy("()") + bytes(8),
        npy("(0, 2)"),
        npy("(1, 2, 1)") + bytes(16),
        npy("(1, 2)", "<c16") + bytes(32),
        npy("(1, 2)", "|b1") + bytes(2),
        b"\x93NUMPY",
        b"",
        b"PK\x03\x04",
        b"\x80\x04K\x01.",
    ],
)
def test_arrays_that_are_no_states(
    content: bytes, tmp_path: Path, problem: Problem, one_sentence: Check
) -> None:
    path = tmp_path / "states.npy"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_states(path, problem)
    assert "states.npy" in one_sentence(caught.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
@pytest.mark.parametrize("name", ["states.csv", "states.npy", "scenario.toml"])
def test_a_pipe_is_not_waited_for(
    name: str, tmp_path: Path, problem: Problem, one_sentence: Check
) -> None:
    path = tmp_path / name
    os.mkfifo(path)
    read = read_toml if name.endswith("toml") else lambda path: read_states(path, problem)
    with pytest.raises(InputError) as caught:
        read(path)
    assert name in one_sentence(caught.value)


def test_settings_that_are_too_large_too_deep_or_marked(tmp_path: Path, one_sentence: Check) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes("\ufeffkey = 1\n".encode())
    assert read_toml(path) == {"key": 1}
    for content, word in (
        ("key = " + "[" * 5000 + "]" * 5000, "too deeply"),
        ("#" * (LARGEST + 1), "MiB"),
        ("key = 1\nkey = 2", "TOML"),
        ("\ufffe", "TOML"),
    ):
        path.write_text(content, encoding="utf-8")
        with pytest.raises(InputError) as caught:
            read_toml(path)
        assert word in one_sentence(caught.value)
    with pytest.raises(InputError, match="no path"):
        read_toml(Path("a\0b.toml"))


def test_a_scenario_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    text = (CASES / "06-bom-scenario.toml").read_bytes()
    assert text.startswith(b"\xef\xbb\xbf")
    (tmp_path / "s.toml").write_bytes(text.replace(b'"v.toml"', b'"bluerov2-heavy"'))
    assert Scenario.load(tmp_path / "s.toml").simulation.duration == 40.0


@pytest.mark.parametrize("name", ["06-states-bom.csv", "06-states-header.csv"])
def test_states_with_a_mark_or_names_are_read(name: str, reference_problem: Problem) -> None:
    first, second = read_states(CASES / name, reference_problem)
    np.testing.assert_array_equal(first[:6], [0.5, -0.3, 0.2, 0.05, 0, 0.3])
    np.testing.assert_array_equal(second, [0.2, *[0.0] * 11])


@pytest.mark.parametrize("text", ["1\nother = 2", "2\n[table]\nkey = 3", "1\r\nb = 1"])
def test_a_set_has_one_key(text: str, one_sentence: Check) -> None:
    with pytest.raises(InputError, match="more than one key") as caught:
        parse_value(text)
    one_sentence(caught.value)
    with pytest.raises(InputError, match="more than one key"):
        parse_values("1]\nb = [2")
    with pytest.raises(InputError, match="too deeply"):
        parse_value("[" * 5000)
    assert parse_value("[1, 2] # both") == [1, 2]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("simulation.duration='10'", ["simulation.duration", "'10'", "number"]),
        ("simulation.duration=true", ["simulation.duration", "True", "number"]),
        ("learner.safeguard=1", ["learner.safeguard", "true or false"]),
        ("simulation.chi=1e9", ["simulation.chi", "1000000"]),
        ("samples.number='5'", ["samples.number", "integer"]),
        ("samples.number=true", ["samples.number", "integer"]),
        ("game.R=[1,1,1,true,1,1]", ["game.R", "number"]),
        ("envelope.half_widths=[1,1,1,'1',1,1,1,1,1,1,1,1]", ["envelope.half_widths", "number"]),
        ("learner.gain_samples='1'", ["learner.gain_samples", "number"]),
        ("simulation.duration=1e7", ["simulation.duration", "1000000"]),
        ("simulation.control_period=200", ["control_period", "control steps"]),
        (
            "simulation={duration=1000, control_period=1e-5, initial_state=[0,0,0,0,0,0,0,0,0,0,0,0]}",
            ["control_period", "control steps"],
        ),
        ("samples.number=2000000", ["samples.number", "1000000"]),
        ("samples.seed=9223372036854775808", ["samples.seed"]),
        ("game.gamma=1e9", ["game.gamma", "1000000"]),
        ("simulation.disturbance.kind='waves'", ["'waves'", "mode is 'game'", "disturbed"]),
    ],
)
def test_types_bounds_and_keys_that_go_together(
    override: str, words: list[str], one_sentence: Check
) -> None:
    with pytest.raises(InputError) as caught:
        Scenario.load(overrides=[override])
    text = one_sentence(caught.value)
    assert all(word in text for word in words), text


def test_a_set_of_several_lines_is_answered_in_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--set", "\n"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_nobody_foresaw_is_a_sentence_with_the_place_of_its_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("nobody thought of that")

    monkeypatch.setattr("stationkeep.comparison.Scenario.load", broken)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert main(["check"]) == 1
    said = capsys.readouterr().err
    (kept,) = tmp_path.glob("stationkeep-*.txt")
    assert said.count("\n") == 1
    assert str(kept) in said
    assert "Traceback" not in said
    assert "nobody thought of that" in kept.read_text(encoding="utf-8")
