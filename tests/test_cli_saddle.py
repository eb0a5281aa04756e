"""`stationkeep offline --saddle`: the keys, and what must be true of the numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from .commands import call, sets

Capture = pytest.CaptureFixture[str]


@pytest.mark.slow
def test_saddle_from_both_sides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = call(capsys, "offline", "--saddle", "--json", "--quiet", *sets("basis.name=quadratic"))
    assert answer.code == 0, answer.err
    (row,) = answer.json()["states"]
    saddle, worst = row["saddle"], row["worst_case"]["linear"]
    assert saddle["second_order"] is True
    assert abs(saddle["gap"]) < 1e-8
    assert saddle["upper"] == pytest.approx(row["value"], rel=1e-8)
    assert saddle["lower"] == pytest.approx(row["value"], rel=1e-8)
    # no policy does better than the saddle point against its own worst disturbance
    assert worst["bounded"] is True
    assert worst["note"] is None
    assert worst["cost"] > row["value"]
    assert worst["excess"] == pytest.approx(worst["cost"] / row["value"] - 1.0)
    assert 1.0 < worst["l2_gain"] < 2.0
