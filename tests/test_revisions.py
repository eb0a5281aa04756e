"""The comparison of two revisions finds a bit that differs, under a new name too, and no clock."""

from __future__ import annotations

import csv
import importlib
import json
import math
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import xarray as xr

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"


def part(name: str) -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(FOLDER), *sys.path])
        return importlib.import_module(f"revision.{name}")


differences, environment, results, times, probe = (
    part(name) for name in ("differences", "environment", "results", "times", "probe")
)


def record(path: Path, cost: str = "cost", last: float = 3.0, **attributes: Any) -> Path:
    data = {cost: ("time", np.array([0.0, np.nan, last])), "fallback": ("time", np.zeros(3, np.int8))}
    coordinates = {"time": ("time", [0.0, 0.1, 0.2], {"units": "s"}), "state": ["x", "y"]}
    path.parent.mkdir(parents=True, exist_ok=True)
    xr.Dataset(data, coordinates, attributes).to_netcdf(path, engine="h5netcdf")
    return path


def test_one_bit_of_one_number_is_found() -> None:
    old = {("a.nc", "zeta"): np.ones((4, 3)), ("a.nc", "cost"): np.arange(5.0)}
    new = {name: values.copy() for name, values in old.items()}
    found = differences.compare(old, new)
    assert (found.compared, found.differing, found.largest) == (17, 0, 0.0)
    new["a.nc", "zeta"][2, 1] = np.nextafter(1.0, 2.0)
    found = differences.compare(old, new)
    assert (found.compared, found.differing, found.where) == (17, 1, "a.nc: zeta")
    assert found.largest == pytest.approx(2.0**-52, rel=1e-9)
    assert not found.only_old
    assert not found.only_new


def test_the_sign_of_zero_counts_and_nan_is_nan() -> None:
    old, new = np.array([0.0, np.nan, np.inf, 1.0]), np.array([-0.0, -np.nan, np.inf, np.nan])
    assert differences.distance(old, new) == (2, math.inf)
    assert differences.distance(old[:3], new[:3]) == (1, 0.0)
    assert differences.distance(np.float64(2.0), np.float64(1.0)) == (1, 0.5)


def test_every_number_of_another_shape_differs() -> None:
    found = differences.compare({("a", "x"): np.zeros(3)}, {("a", "x"): np.zeros(7)})
    assert (found.compared, found.differing, found.largest) == (7, 7, math.inf)


def test_renamed_names_are_compared_and_others_are_told() -> None:
    old = {("a.json", "states", "0", "defect"): np.array([1.0]), ("gone.nc", "zeta"): np.zeros(2)}
    new = {("a.json", "states", "0", "gap"): np.array([2.0]), ("a.json", "more"): np.zeros(1)}
    found = differences.compare(old, new, renamed={"defect": "gap"})
    assert (found.compared, found.differing, found.largest) == (1, 1, 0.5)
    assert found.only_old == ["gone.nc"]
    assert found.only_new == ["a.json: more"]
    found = differences.compare(old, new)  # "defect" is not said to be "gap"
    assert found.compared == 0
    assert found.only_old == ["gone.nc", "a.json: states.0.defect"]


def test_what_many_files_lack_is_told_once() -> None:
    old = {(file, name): np.ones(1) for file in ("a.nc", "b.nc") for name in ("cost", "zeta", "u")}
    new = {name: values for name, values in old.items() if name[1] == "u" or name == ("a.nc", "zeta")}
    assert differences.compare(old, new).only_old == ["cost in 2 files", "b.nc: zeta"]


def test_excluded_names_are_not_compared() -> None:
    names = ("wall_seconds", "policy_mean", "numpy_version", "key")
    old = {("a.nc", "attributes", name): np.array(1.0) for name in names}
    new = {name: values + 1.0 for name, values in old.items()}
    assert differences.compare(old, new).compared == 0
    assert differences.compare(old, new, excluded=()).differing == len(names)
    assert differences.compare({("a", "t", "x"): np.ones(1)}, {}, excluded=["t*"]).only_old == []


def test_a_record_is_read_whole_but_for_its_texts(tmp_path: Path) -> None:
    old = differences.read(record(tmp_path / "old.nc", seed=1, wall_seconds=2.0, kind="x"), "r.nc")
    names = {name[1:] for name in old}
    own = {("attributes", "seed"), ("attributes", "wall_seconds")}
    assert names == {("cost",), ("fallback",), ("time",), *own}
    last = np.nextafter(3.0, 4.0)
    new = differences.read(record(tmp_path / "new.nc", "J", last, seed=1, wall_seconds=3.0), "r.nc")
    found = differences.compare(old, new, renamed={"cost": "J"})
    assert (found.compared, found.differing, found.where) == (10, 1, "r.nc: J")


def test_numbers_of_an_answer_have_names(tmp_path: Path) -> None:
    answer = {
        "P": [[1, 2.5], [None, 4]],
        "conditions": [{"name": "a", "holds": True, "note": "x"}, {"name": "b", "holds": None}],
        "rows": [{"seconds": 0.1, "value": 7}, {"value": 8}],
        "faults": [],
    }
    path = tmp_path / "answer.json"
    path.write_text(json.dumps(answer), encoding="utf-8")
    read = differences.read(path, "f")
    expected = {
        ("P", "0"): [1.0, 2.5],
        ("P", "1"): [math.nan, 4.0],
        ("conditions", "a", "holds"): 1.0,
        ("conditions", "b", "holds"): math.nan,
        ("rows", "0", "seconds"): 0.1,
        ("rows", "0", "value"): 7.0,
        ("rows", "1", "value"): 8.0,
    }
    assert {name[1:] for name in read} == set(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(read["f", *name], values)


def results_of(folder: Path, digest: str, last: float) -> Any:
    """Return a revision whose sweep left a table of two runs, and the record of one of them."""
    home = folder / "results" / "sweep"
    record(home / "out" / "runs" / f"{digest}.nc", last=last)
    rows = [
        {"run": 0, "cost": 1.5, "failed": False, "seconds": last, "reason": "", "record": ""},
        {"run": 1, "cost": "", "failed": True, "seconds": 2, "record": f"runs/{digest}.nc"},
    ]
    with (home / "out" / "sweep.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, rows[0], restval="")
        table.writeheader()
        table.writerows(rows)
    (home / results.ANSWER).write_text('{"runs": 2}', encoding="utf-8")
    (home / results.KEPT).write_text('{"code": 1}', encoding="utf-8")
    return environment.Revision("OLD", "0" * 40, folder)


def test_records_of_a_sweep_are_told_apart_by_their_runs(tmp_path: Path) -> None:
    old = results.numbers(results_of(tmp_path / "old", "0f", 3.0), "sweep")
    new = results.numbers(results_of(tmp_path / "new", "f0", 3.5), "sweep")
    assert set(old) == {"JSON", "CSV", "netCDF"}
    found = {kind: differences.compare(old[kind], new[kind]) for kind in old}
    assert (found["netCDF"].differing, found["netCDF"].where) == (1, "out/run 1: cost")
    assert (found["CSV"].compared, found["CSV"].differing) == (6, 0), "run, cost and failed"
    assert (found["JSON"].compared, found["JSON"].differing) == (2, 0), "runs and the exit code"
    for each in found.values():
        assert not each.only_old
        assert not each.only_new


def test_interval_of_a_median_by_order_statistics() -> None:
    """As in tables of the sign test: ranks 6 and 15 of 20 enclose it with 95.86 %, 1 and 6 of 6."""
    values = np.random.default_rng(0).permutation(20) + 1.0
    assert times.interval(values) == (6.0, 15.0)
    assert times.interval(values, 0.96) == (5.0, 16.0)
    assert times.interval([6, 5, 4, 3, 2, 1]) == (1, 6)
    assert all(math.isnan(end) for end in times.interval([1.0] * 5))


def test_ratios_are_taken_pair_by_pair() -> None:
    drifting = np.geomspace(1.0, 100.0, 21)
    ratio = times.paired(drifting, 2.0 * drifting)
    assert (ratio.median, ratio.low, ratio.high) == (2.0, 2.0, 2.0)
    assert ratio.old == pytest.approx(10.0)
    alone = times.paired([math.nan] * 20, drifting[:20])
    assert math.isnan(alone.median)


def test_an_unknown_revision_is_refused_in_a_sentence(tmp_path: Path) -> None:
    command = [sys.executable, "-B", str(FOLDER / "revisions.py"), "no-such-revision"]
    done = subprocess.run(
        [*command, "--folder", str(tmp_path)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert done.stderr.startswith("there is no revision 'no-such-revision'")
    assert len(done.stderr.splitlines()) == 1
    assert not any(tmp_path.iterdir())


def test_the_probe_finds_public_names_and_says_which_it_lacks(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from stationkeep.online import Controller

    assert probe.public("online", "Controller") is Controller
    probe.main("import", "json")
    assert set(json.loads(capsys.readouterr().out)) == {"import, processor", "import, wall"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(probe, "loop", lambda: probe.public("online", "nothing"))
        probe.main("loop")
    assert "'nothing'" in json.loads(capsys.readouterr().out)["lacks"]
