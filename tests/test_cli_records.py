"""`replay` and `export` as a user runs them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from stationkeep.comparison.adapters.matlab import matlab_name
from stationkeep.comparison.records import online_record
from stationkeep.online import load, save

from .commands import QUICK, call, run, sets
from .games import quick_scenario


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of a learned record of half a second."""
    path = tmp_path_factory.mktemp("records") / "learned.nc"
    online_record(quick_scenario("simulation.duration=0.5"), path)
    return path


def altered(record: Path, folder: Path, factor: float) -> Path:
    """Return a copy whose last state is a multiple of what was recorded."""
    changed = load(record)
    changed["zeta"][-1] *= factor
    return save(changed, folder / "altered.nc")


def test_a_fresh_record_is_bit_equal(tmp_path: Path) -> None:
    """ComparedRuns and replayed as a user does; within another process BLAS may have more threads."""
    settings = sets(*QUICK, "simulation.duration=0.5")
    assert run("online", "--quiet", "--out", ".", *settings, cwd=tmp_path).code == 0
    answer = run("replay", "learned.nc", "--json", "--quiet", cwd=tmp_path)
    assert answer.code == 0, answer.err
    assert answer.err == ""
    found = answer.json()
    assert (found["verdict"], found["max_difference"]) == ("bit-equal", 0.0)
    assert found["first"] == {"variable": None, "time": None}


def test_within_tolerance_and_different(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = call(capsys, "replay", str(altered(record, tmp_path, 1 + 1e-9)), "--json", "--quiet")
    assert answer.code == 0
    assert answer.json()["verdict"] == "within tolerance"
    path = altered(record, tmp_path, 1.001)
    answer = call(capsys, "replay", str(path), "--json", "--quiet")
    assert answer.code == 1
    found = answer.json()
    assert found["verdict"] == "different"
    assert 1e-6 < found["max_difference"] <= 1e-3
    assert found["first"]["variable"] == "zeta"
    assert found["first"]["time"] == pytest.approx(0.5)
    answer = call(capsys, "replay", str(path), "--quiet", "--tolerance", "0.01")
    assert answer.code == 0
    assert answer.out.startswith("within tolerance")
    assert "zeta at t = 0.50 s" in answer.out
    assert "generated code are the record's own" in answer.out


def test_the_new_record_is_kept_where_asked(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new = tmp_path / "again" / "new.nc"
    answer = call(capsys, "replay", str(record), "--quiet", "--out", str(new))
    assert answer.code == 0
    np.testing.assert_array_equal(load(new)["zeta"], load(record)["zeta"])
    assert call(capsys, "replay", str(new), "--quiet").out.startswith("bit-equal")


@pytest.mark.parametrize("command", ["replay", "export"])
def test_bad_records(
    command: str, record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truncated, text = tmp_path / "truncated.nc", tmp_path / "text.nc"
    truncated.write_bytes(record.read_bytes()[:5000])
    text.write_text("not a record", encoding="utf-8")
    for path in (truncated, text, tmp_path / "missing.nc", tmp_path):
        answer = call(capsys, command, str(path), "--quiet")
        assert answer.code == 2
        assert answer.out == ""
        assert str(path) in answer.sentence()
    assert call(capsys, command).code == 2


def test_a_file_that_is_no_run(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save(load(record).drop_attrs(), tmp_path / "other.nc")
    answer = call(capsys, "replay", str(path))
    assert answer.code == 2
    assert "no record" in answer.sentence()


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "inf"])
def test_bad_tolerances(tolerance: str, record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = call(capsys, "replay", str(record), f"--tolerance={tolerance}")
    assert answer.code == 2
    assert "--tolerance" in answer.sentence()


def test_matlab_gets_the_same_numbers(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "learned.mat"
    answer = call(capsys, "export", str(record), "--out", str(path), "--json")
    assert answer.code == 0
    found, kept = scipy.io.loadmat(path, squeeze_me=True, simplify_cells=True), load(record)
    names = set(answer.json()["variables"])
    assert names == {name for name in found if not name.startswith("__")}
    assert {"time", "zeta", "critic", "units", "dimensions", "provenance"} <= names
    for name in kept.variables:
        if kept[name].dtype.kind in "fi":
            np.testing.assert_array_equal(found[str(name)], kept[name])
            assert found["units"][str(name)] == kept[name].attrs["units"]
    assert list(found["state"]) == list(kept["state"].values)
    assert found["dimensions"]["zeta"] == "time x state"
    assert found["provenance"]["scenario"] == kept.attrs["scenario"]
    assert found["provenance"]["key"] == kept.attrs["key"]
    raw = scipy.io.loadmat(path)
    assert raw["time"].shape == (26, 1), "a column"
    assert raw["zeta"].shape == (26, 12)


def test_matlab_files_lie_beside_the_record_and_end_with_mat(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "mine.nc"
    copy.write_bytes(record.read_bytes())
    assert call(capsys, "export", str(copy)).out.startswith(str(tmp_path / "mine.mat"))
    answer = call(capsys, "export", str(copy), "--out", str(tmp_path / "mine.csv"))
    assert answer.code == 2
    assert ".mat" in answer.sentence()
    assert not (tmp_path / "mine.csv").exists()


def test_names_that_matlab_takes() -> None:
    assert matlab_name("tau_b") == "tau_b"
    assert matlab_name("2nd x/dot") == "x2nd_x_dot"
    assert matlab_name("_x") == "x_x"
    assert matlab_name("end") == "end_"
    assert matlab_name("for") == "for_"
    assert len(matlab_name("x" * 100)) == 63
