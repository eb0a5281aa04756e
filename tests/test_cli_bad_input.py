"""Bad commands and settings: one sentence about what was given and what is required; exit code 2."""

from __future__ import annotations

from pathlib import Path

import pytest
from stationkeep.comparison import Scenario

from .commands import QUICK, call, files_in, run, sets

Capture = pytest.CaptureFixture[str]

# arguments and words that the one sentence must hold
WORDS = [
    (["onlien"], ["onlien", "online", "--help"]),
    ([], ["COMMAND", "--help"]),
    (["online", "--bogus"], ["--bogus", "--help"]),
    (["online", "bluerov2-hevy"], ["bluerov2-hevy", "did you mean 'bluerov2-heavy'", ".toml"]),
    (["online", "zzz"], ["zzz", "bluerov2-heavy", ".toml"]),
    (["online", "no/such.toml"], ["no/such.toml", "no file"]),
    (["compare", "--n-states", "0"], ["--n-states", "0", "at least 1"]),
    (["compare", "--n-states", "few"], ["--n-states", "few"]),
    (["offline", "--state"], ["--state"]),
    (["check", "--set"], ["--set"]),
    (["check", "--set", "gamma"], ["--set gamma", "section.key=value"]),
    (["check", "--set", "=3"], ["--set =3", "section.key=value"]),
    (["check", "--set", "vehicle.mass=3"], ["vehicle.mass=3", "'vehicle' is a value"]),
    (["check", "--set", "game.gamma.x=3"], ["game.gamma.x=3", "'gamma' is a value"]),
]

# --set KEY=VALUE and words that the one sentence must hold
SETTINGS = [
    ("game.gama=3", ["unknown key 'game.gama'", "did you mean 'gamma'"]),
    ("gaem.gamma=3", ["unknown key 'gaem'", "did you mean 'game'"]),
    ("simulation.disturbance.fource=3", ["simulation.disturbance.fource", "did you mean 'force'"]),
    ("game=3", ["'game'", "3", "table"]),
    ("vehicle=3", ["'vehicle'", "3"]),
    ("vehicle='bluerov'", ["no vehicle 'bluerov'", "bluerov2-heavy"]),
    ("vehicle='mine.toml'", ["mine.toml", "no file"]),
    ("game.gamma=abc", ["'game.gamma'", "abc", "number"]),
    ("game.gamma=", ["'game.gamma'", "number"]),
    ("game.gamma=-1", ["'game.gamma'", "-1", "greater than 0"]),
    ("game.gamma=nan", ["'game.gamma'", "nan", "finite"]),
    ("game.gamma=inf", ["'game.gamma'", "inf", "finite"]),
    ("game.Q=5", ["'game.Q'", "5"]),
    ("game.Q='abc'", ["'game.Q'", "abc"]),
    ("game.Q=[1, 2", ["game.Q", "[1, 2"]),
    ("game.Q=[1,1,1,1,1,1,1,1,1,1,1]", ["Q", "11", "12"]),
    ("game.Q=[[1,2],[3]]", ["Q"]),
    ("game.R=[1,1,1,1,1]", ["R", "5", "6"]),
    ("game.W_d=[1,1,1,1,1]", ["W_d", "5", "6"]),
    ("game.W_d='Q'", ["W_d", "'Q'", '"R"']),
    ("game.Q=[1,1,1,1,1,1,1,1,1,1,1,-20]", ["Q", "positive definite", "-20"]),
    ("game.R=[1,1,1,1,1,0]", ["R", "positive definite", "0"]),
    ("game.W_d=[1,1,1,1,1,-1]", ["W_d", "positive definite", "-1"]),
    ("current=[1,2]", ["'current'", "[1, 2]"]),
    ("simulation.initial_state=[1,1,1,1,1,1,1,1,1,1,1]", ["initial_state", "12", "11"]),
    ("simulation.initial_state=[0,0,0,0,1.6,0,0,0,0,0,0,0]", ["pitch", "91.7 deg", "90 deg"]),
    ("simulation.initial_state=[0,0,0,0,-1.6,0,0,0,0,0,0,0]", ["pitch", "-91.7 deg", "90 deg"]),
    ("simulation.initial_state=[nan,0,0,0,0,0,0,0,0,0,0,0]", ["initial_state", "nan", "finite"]),
    ("simulation.mode='fast'", ["'simulation.mode'", "fast", "'game'", "'disturbed'"]),
    ("simulation.disturbance.kind='rain'", ["rain", "'current'", "'waves'"]),
    ("simulation.duration=0", ["'simulation.duration'", "0", "greater than 0"]),
    ("simulation.pitch_limit=90", ["'simulation.pitch_limit'", "90", "less than 90"]),
    ("samples.number=1.5", ["'samples.number'", "1.5", "integer"]),
    ("samples.number=-1", ["'samples.number'", "-1", "0"]),
    ("samples.number=many", ["'samples.number'", "many", "integer"]),
    ("envelope.half_widths=[1,2]", ["half_widths", "12", "2"]),
    ("envelope.half_widths=[1,1,1,1,1,1,1,1,1,1,1,0]", ["half_widths", "positive"]),
    ("learner.rule='sgd'", ["'learner.rule'", "sgd", "'gradient'", "'least_squares'"]),
    ("learner.weight_bound=0.5", ["'learner.weight_bound'", "0.5", "greater than 1"]),
    ("learner.covariance=1e9", ["covariance", "1e+09", "covariance_bound", "1e+08"]),
    ("offline.degree=12", ["'offline.degree'", "12", "8"]),
    ("offline.aligned=3", ["'offline.aligned'", "3", "true"]),
    ("basis.name=drg", ["no basis 'drg'", "did you mean 'drag'", "file.py:function"]),
    ("learner.weights=none.nc", ["none.nc", "no record"]),
]


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("arguments", "words"), WORDS, ids=lambda value: " ".join(value) or "none")
def test_bad_command_lines(
    arguments: list[str], words: list[str], tmp_path: Path, capsys: Capture
) -> None:
    answer = call(capsys, *arguments)
    assert answer.code == 2
    assert answer.out == ""
    text = answer.sentence()
    for word in words:
        assert word in text, text
    assert files_in(tmp_path) == []


@pytest.mark.parametrize(("override", "words"), SETTINGS, ids=[case[0] for case in SETTINGS])
def test_bad_settings(override: str, words: list[str], tmp_path: Path, capsys: Capture) -> None:
    answer = call(capsys, "check", "--quiet", "--json", *sets(*QUICK, override))
    assert answer.code == 2
    assert answer.out == ""
    text = answer.sentence()
    for word in words:
        assert word in text, text
    assert files_in(tmp_path) == []


@pytest.mark.parametrize("gamma", [0.5, 1.0])
def test_gamma_too_small_names_gamma_star(gamma: float, capsys: Capture) -> None:
    text = call(capsys, "check", "--quiet", "--set", f"game.gamma={gamma}").sentence()
    assert f"gamma = {gamma:g} is too small" in text
    assert "R^-1 - gamma^-2 W_d^-1" in text
    assert "gamma* of the linearised game is 1)" in text
    assert "increase gamma" in text


def test_gamma_star_depends_on_the_disturbance_weight(capsys: Capture) -> None:
    """With W_d = I the threshold is sqrt(λ_max(R)) = sqrt(10)."""
    settings = sets("game.gamma=3", "game.W_d=[1,1,1,1,1,1]")
    text = call(capsys, "check", "--quiet", *settings).sentence()
    assert text.count("3.16228") == 2


@pytest.mark.parametrize("command", ["generate", "online", "offline", "compare", "check"])
def test_every_command_refuses_a_bad_scenario(command: str, tmp_path: Path, capsys: Capture) -> None:
    for override in ("game.gama=3", "game.gamma=0.5"):
        answer = call(capsys, command, "--quiet", "--json", "--set", override)
        assert answer.code == 2
        assert answer.out == ""
        assert "gamma" in answer.sentence()
    assert files_in(tmp_path) == []


@pytest.mark.parametrize("command", ["generate", "online", "offline", "compare", "check"])
def test_a_message_has_no_blank_line_before_it(command: str, capsys: Capture) -> None:
    """Progress, where it isn't drawn on a terminal, must not leave lines behind."""
    assert "gamma" in call(capsys, command, "--set", "game.gamma=0.5").sentence()


@pytest.mark.parametrize(
    ("line", "replacement", "words"),
    [
        ("gamma = 2.0", "gama = 2.0", ["unknown key 'game.gama'", "did you mean 'gamma'"]),
        ("gamma = 2.0", "", ["'game.gamma'", "missing"]),
        ('vehicle = "bluerov2-heavy"', "", ["'vehicle'", "missing"]),
        ("[envelope]", "[envelop]", ["unknown key 'envelop'", "did you mean 'envelope'"]),
        ("gamma = 2.0", "gamma = 2.0\ngamma = 3.0", ["not valid TOML", "line 10"]),
        ("gamma = 2.0", "gamma = 2,0", ["not valid TOML", "line 9"]),
        ("[basis]", "[samples]\nfurther = 1\n\n[basis]", ["unknown key 'samples.further'"]),
    ],
)
def test_faults_of_a_scenario_file(
    line: str, replacement: str, words: list[str], tmp_path: Path, capsys: Capture
) -> None:
    text = shipped_text()
    assert line in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(line, replacement, 1), encoding="utf-8")
    answer = call(capsys, "online", str(path), "--quiet")
    assert answer.code == 2
    sentence = answer.sentence()
    for word in ("mine.toml", *words):
        assert word in sentence, sentence
    assert files_in(tmp_path) == ["mine.toml"]


def test_the_sentence_of_the_script(tmp_path: Path) -> None:
    """What is checked in this process elsewhere, once as the user's process prints it."""
    answer = run("check", "--set", "game.gama=3", cwd=tmp_path)
    assert answer.code == 2
    assert answer.out == ""
    assert answer.err.startswith("stationkeep: scenario 'bluerov2-heavy': unknown key 'game.gama'")
    assert answer.sentence()


def shipped_text() -> str:
    """Return the text of the shipped scenario."""
    folder = Path(__file__).resolve().parents[1] / "comparison" / "scenario" / "scenarios"
    assert "bluerov2-heavy" in Scenario.shipped()
    return (folder / "bluerov2-heavy.toml").read_text(encoding="utf-8")
