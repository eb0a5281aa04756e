"""A record of a run of one's own vehicle is all that is needed of it, wherever it is."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from stationkeep import Scenario, check, replay
from stationkeep.comparison.records import online_record, recorded_scenario
from stationkeep.online import load, load_weights


def test_check_replay_and_weights_need_the_record_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shipped = resources.files("stationkeep") / "symbolic/underwater/vehicles/bluerov2-heavy.toml"
    own = tmp_path / "own.toml"
    own.write_text(shipped.read_text(encoding="utf-8").replace("mass = 13.5", "mass = 13.6"))
    sets = ("vehicle=own.toml", "basis.name=quadratic", "simulation.duration=0.3", "samples.number=20")
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "run.nc"
    online_record(Scenario.load(overrides=sets), path)
    own.unlink()
    monkeypatch.chdir("/")
    assert replay(path).verdict == "bit-equal"
    record = load(path)
    rows, of_scenario = check(record=path), check(recorded_scenario(record))
    assert {row.name for row in rows} > {row.name for row in of_scenario}
    np.testing.assert_array_equal(load_weights(path), record["critic"].values[-1])
    assert '"mass":13.6' in record.attrs["vehicle"]
