"""`stationkeep offline --gammas`: the curve in the JSON, its table, its figure, and bad levels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from .commands import LOOSE, QUICK, ROUGH, call, files_in, sets

Capture = pytest.CaptureFixture[str]
STATES = ("--state", "0.3,0,0,0,0,0.1,0,0,0,0,0,0", "--state", "-0.5,0.2,0,0,0,0,0,0,0,0,0,0")
SETTINGS = sets(*QUICK, *ROUGH, *LOOSE)


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_curves_in_the_json_and_a_figure(tmp_path: Path, capsys: Capture) -> None:
    options = ("--gammas", "5,1.2,2", "--json", "--quiet", "--out", "there")
    answer = call(capsys, "offline", *STATES, *SETTINGS, *options)
    assert answer.code == 0, answer.err
    rows: list[dict[str, Any]] = answer.json()["states"]
    assert len(rows) == 2
    for row in rows:
        points = row["gamma_curve"]
        assert [point["gamma"] for point in points] == [1.2, 2.0, 5.0]
        assert all(set(point) == {"gamma", "value", "linear_value", "slope"} for point in points)
        values = [point["value"] for point in points]
        assert values[0] > values[1] > values[2] > row["undisturbed_value"] > 0.0
        # the scenario's own gamma is 2; the certified solve is rough here
        assert values[1] == pytest.approx(row["value"], rel=1e-2)
        assert row["faults"] == []
    assert (tmp_path / "there" / "gamma-curve.png").read_bytes().startswith(b"\x89PNG")


def test_grid_is_printed_as_a_table(tmp_path: Path, capsys: Capture) -> None:
    answer = call(capsys, "offline", *STATES[:2], *SETTINGS, "--gammas", "grid", "--quiet")
    assert answer.code == 0, answer.err
    assert "Value against gamma" in answer.out
    assert "1.05" in answer.out
    assert "without disturbance" in answer.out
    assert "results/bluerov2-heavy/gamma-curve.png" in files_in(tmp_path)


@pytest.mark.parametrize(
    ("gammas", "words"),
    [
        ("2,1", "gamma* of the linearised game is 1)"),
        ("0.9", "gamma = 0.9 is too small"),
        ("-2,3", "positive"),
        ("2,three", "numbers with commas between"),
        ("", "numbers with commas between"),
        ("inf", "finite"),
    ],
)
def test_bad_levels_write_nothing(gammas: str, words: str, tmp_path: Path, capsys: Capture) -> None:
    answer = call(capsys, "offline", "--quiet", "--json", "--gammas", gammas)
    assert answer.code == 2
    assert answer.out == ""
    assert words in answer.sentence()
    assert files_in(tmp_path) == []
