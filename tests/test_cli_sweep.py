"""`stationkeep sweep`: what is in its table, what it says, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import run_metrics
from stationkeep.comparison.records import contender_record
from stationkeep.comparison.sweep.vary import varied
from stationkeep.offline import QuickValue
from stationkeep.online import draw_samples, load

from .commands import QUICK, call, files_in, sets
from .games import HALF_WIDTHS
from .sweeps import SETTINGS, table

Capture = pytest.CaptureFixture[str]
WORDS = ("sweep", "--quiet", "--json", "--workers", "1", "--out", "out", *SETTINGS)


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_rows_are_the_runs_that_were_asked_for(user_folder: Path, capsys: Capture) -> None:
    """Every number of a row is that of the run made by itself; records are thinned, not changed."""
    vary = ("--scales", "0.1,0.5", "--vary", "plant.mass.factor=0.9:1.1", "--samples", "1")
    answer = call(capsys, *WORDS, "--states", "2", "--seed", "5", *vary)
    assert answer.code == 0, answer.err
    told = answer.json()
    assert (told["runs"], told["failed"], told["resumed"]) == (8, 0, 0)
    with xr.open_dataset(told["table"]) as dataset:
        rows = dataset.load()
    assert rows.sizes == {"run": 8}
    base = Scenario.load(overrides=QUICK)
    for i in (0, 3, 6):
        row = {str(name): value.item() for name, value in rows.isel(run=i).variables.items()}
        scale = (0.1, 0.5)[i // 4]
        assert (row["run"], row["envelope.scale"], row["state"]) == (i, scale, i % 4 // 2)
        zeta = draw_samples(scale * HALF_WIDTHS, 2, 5)[i % 4 // 2]
        one = varied(
            base,
            {
                "envelope.scale": scale,
                "plant.mass.factor": row["plant.mass.factor"],
                "simulation.initial_state": tuple(zeta.tolist()),
            },
        )
        assert row["policy"] == ("learned", "linear")[i % 2]
        record, station = contender_record(one, row["policy"]), one.station_keeping()
        value = QuickValue(station.problem)
        optimum = value(zeta)
        metrics = run_metrics(record, station, optimum, value)
        assert row["optimum"] == optimum
        for name in ("cost", "regret", "position_rms", "energy", "effort", "rest_share"):
            assert row[name] == getattr(metrics, name), name
        assert row["ended"] == 2.0
        kept = load(user_folder / "out" / row["record"])
        spacing = np.diff(kept["time"].values)
        np.testing.assert_allclose(spacing, 0.2, rtol=1e-9)
        at = record.sel(time=kept["time"].values)
        for name in ("zeta", "tau_b", "cost"):
            np.testing.assert_array_equal(kept[name].values, at[name].values)
        assert kept.attrs["sweep_key"] in row["record"]
        np.testing.assert_array_equal(kept["critic"].values[-1:], record["critic"].values[-1:])
    assert [float(row["regret"]) for row in table("out")] == rows["regret"].values.tolist()
    groups = {(group["settings"]["envelope.scale"], group["policy"]) for group in told["summary"]}
    assert groups == {(scale, name) for scale in (0.1, 0.5) for name in ("learned", "linear")}


@pytest.mark.slow
def test_a_longer_sweep_keeps_what_a_shorter_one_made(user_folder: Path, capsys: Capture) -> None:
    """And a corrupted or missing record, or a lost journal line, costs that run only."""
    first = call(capsys, *WORDS, "--states", "2")
    assert first.code == 0, first.err
    before = table("out")
    again = call(capsys, *WORDS, "--states", "2").json()
    assert (again["runs"], again["resumed"]) == (4, 4)
    more = (*WORDS, "--states", "2", "--policies", "lqr,learned,linear")
    longer = call(capsys, *more).json()
    assert (longer["runs"], longer["resumed"]) == (6, 4)
    whole = table("out")
    kept = [row for row in whole if row["policy"] != "lqr"]
    assert [row | {"run": str(i)} for i, row in enumerate(kept)] == before

    broken = user_folder / "out" / before[1]["record"]
    content = bytearray(broken.read_bytes())
    content[len(content) // 2] ^= 1
    broken.write_bytes(content)
    (user_folder / "out" / before[2]["record"]).unlink()
    healed = call(capsys, *more).json()
    assert (healed["runs"], healed["resumed"]) == (6, 4)
    assert table("out") == whole
    assert load(broken)["time"].values[-1] == 2.0

    journal = user_folder / "out" / "sweep.journal"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join([*lines[:2], b"\xff\x00 nonsense\n", *lines[3:]]))
    assert call(capsys, *more).json()["resumed"] == 6, "its record is whole"
    journal.unlink()
    assert call(capsys, *more).json()["resumed"] == 6
    assert table("out") == whole


def test_runs_that_fail_are_rows_with_their_reason(user_folder: Path, capsys: Capture) -> None:
    """γ below its bound, a period too long to hold the game; the rest goes on."""
    words = ("--vary", "game.gamma=0.9,2", "--vary", "simulation.control_period=0.02,1.0")
    words += tuple(sets("simulation.duration=4"))
    answer = call(capsys, *WORDS, *words)
    assert answer.code == 1
    told = answer.json()
    rows = table("out")
    assert told["runs"] == len(rows) == 8
    for row in rows[:4]:
        assert row["failed"] == "True"
        assert "gamma = 0.9 is too small" in row["reason"]
        assert row["cost"] == row["record"] == ""
    assert [row["failed"] for row in rows[4:6]] == ["False"] * 2
    for row in rows[6:]:
        assert row["failed"] == "True", row
        assert "a control period of 1 s can't hold this game" in row["reason"]
        assert row["cost"] == row["record"] == ""
    assert told["failed"] == 6
    for group in told["summary"]:
        regret = group["regret"]
        assert (regret["median"] is None) == ("note" in regret) == (group["failed"] > 0), group
        assert regret["diverged"] == 0  # of what never started there is no optimum either
    again = call(capsys, *WORDS, *words)
    assert (again.code, again.json()["resumed"]) == (1, 8), "they would fail so again"


def test_only_the_records_of_failed_runs(user_folder: Path, capsys: Capture) -> None:
    words = ("--vary", "simulation.chi=0.01,2", "--records", "failed", "--every", "0")
    call(capsys, *WORDS, *words)
    rows = table("out")
    assert [row["failed"] for row in rows] == ["True", "True", "False", "False"]
    assert [row["record"] != "" for row in rows] == [True, True, False, False]
    assert len(files_in(user_folder / "out" / "runs")) == 2


def test_what_is_printed(user_folder: Path, capsys: Capture) -> None:
    words = tuple(word for word in WORDS if word != "--json")
    answer = call(capsys, *words, "--vary", "basis.name=quadratic")
    assert answer.code == 0
    for text in ("learned", "linear", "quadratic", "median / 90 % / max", "2 runs, 0 failed"):
        assert text in answer.out
    assert "raise simulation.duration" in answer.out, "2 s are too short for a regret"


def test_disturbed_runs_have_a_margin_and_no_regret(capsys: Capture) -> None:
    current = ("--vary", "simulation.disturbance.velocity[0]=0.1,0.2")
    settings = sets("simulation.mode=disturbed", "simulation.disturbance.kind=current")
    answer = call(capsys, *WORDS, *current, *settings)
    assert answer.code == 0, answer.err
    rows = table("out")
    assert [float(row["simulation.disturbance.velocity[0]"]) for row in rows] == [0.1, 0.1, 0.2, 0.2]
    assert all(row["regret"] == row["optimum"] == "" for row in rows)
    assert all(float(row["dissipation_margin"]) != 0.0 for row in rows)


BAD = [
    (("--policies", "learned,liner"), "did you mean 'linear'"),
    (("--states", "0"), "--states is 0"),
    (("--states", "nowhere.csv"), "there is no file 'nowhere.csv'"),
    (("--scales", "0.1,-1"), "greater than 0"),
    (("--vary", "game.gama=2"), "did you mean 'gamma'"),
    (("--vary", "game.gamma=2:3"), "--samples"),
    (("--samples", "3"), "--samples"),
    (("--samples", "0", "--vary", "game.gamma=2:3"), "--samples is 0"),
    (("--seed", "-1"), "--seed is -1"),
    (("--every", "-1"), "--every is -1"),
    (("--cluster", "tcp://localhost:1", "--workers", "2"), "--workers is for this machine"),
]


@pytest.mark.parametrize(("words", "sentence"), BAD)
def test_bad_input(words: tuple[str, ...], sentence: str, user_folder: Path, capsys: Capture) -> None:
    answer = call(capsys, "sweep", "--quiet", *sets(*QUICK), *words)
    assert answer.code == 2
    assert sentence in answer.sentence()
    assert [name for name in files_in(user_folder) if "sweep.journal" not in name] == []


def test_without_dask(user_folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    answer = call(capsys, "sweep", "--quiet", "--cluster", "tcp://localhost:1", *sets(*QUICK))
    assert answer.code == 2
    assert "pip install 'stationkeep[cluster]'" in answer.sentence()


def test_states_from_a_file_and_json_contract(user_folder: Path, capsys: Capture) -> None:
    states = 0.1 * HALF_WIDTHS * np.array([[1.0], [-0.5]])
    np.save("states.npy", states)
    words = ("--states", "states.npy", "--policies", "linear", "--records", "none")
    answer = call(capsys, "sweep", "--json", "--quiet", *sets(*QUICK), *words)
    told = json.loads(answer.out)
    assert told["table"] == "results/bluerov2-heavy/sweep/sweep.nc"
    assert (told["runs"], told["failed"]) == (2, 0)
    rows = table("results/bluerov2-heavy/sweep")
    assert [float(row["initial_psi"]) for row in rows] == [0.1, -0.05]
    assert "runs" not in [Path(name).parent.name for name in files_in(user_folder)]
