"""Records: complete on disk, with units and provenance, or refused in one sentence."""

from __future__ import annotations

import errno
import resource
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.online import VehicleHistory, load, load_weights, run, save, to_dataset
from stationkeep.online.records import write_text, written_whole
from stationkeep.symbolic import InputError

from .games import QUICK, Array, quick_scenario

PROBLEM = quick_scenario().setup().problem

Check = Callable[[BaseException], str]


@cache
def history() -> VehicleHistory:
    return run(quick_scenario("simulation.duration=0.6"))


@pytest.fixture
def dataset() -> xr.Dataset:
    return to_dataset(history(), {"scenario": "text of it", "seed": 1})


def test_dimensions_and_units(dataset: xr.Dataset) -> None:
    assert dict(dataset.sizes) == {
        "time": 31,
        "learn_time": 4,  # at once, at 0.26 s, at 0.52 s and the end
        "state": 12,
        "input": 6,
        "force": 6,
        "basis": 78,
        "look_time": 2,  # at once and the end
        "player": 2,
    }
    for name, variable in dataset.data_vars.items():
        assert variable.attrs["units"], name
        assert variable.dims[0] in ("time", "learn_time", "look_time"), name
    assert dataset["time"].attrs["units"] == "s"
    assert dataset["learn_time"].attrs["units"] == dataset["look_time"].attrs["units"] == "s"
    assert list(dataset["state"].values[[0, 4, 11]]) == ["x", "theta", "psi_dot"]
    assert list(dataset["force"].values) == ["X", "Y", "Z", "K", "M", "N"]


def test_dataset_holds_the_looks(dataset: xr.Dataset) -> None:
    looks = history().looks
    for name in vars(looks[0]):
        stored = dataset["look_time" if name == "time" else name]
        np.testing.assert_array_equal(stored.values, [getattr(look, name) for look in looks])
    assert list(dataset["player"].values) == ["control", "disturbance"]


def test_dataset_holds_the_run(dataset: xr.Dataset) -> None:
    run_of = history()
    for name, values in {
        "time": run_of.time,
        "zeta": run_of.zeta,
        "tau_b": run_of.tau_b,
        "u_control": run_of.u_control,
        "u_disturbance": run_of.disturbance,
        "cost": run_of.cost,
        "attenuated": run_of.attenuated,
        "bellman_error": run_of.bellman_error,
        "critic": run_of.critic,
        "actor_2": run_of.actor_2,
    }.items():
        np.testing.assert_array_equal(dataset[name].values, np.array(values))


def test_provenance(dataset: xr.Dataset) -> None:
    attributes = dataset.attrs
    assert attributes["scenario"] == "text of it"
    assert attributes["seed"] == 1
    for package in ("stationkeep", "casadi", "numpy", "scipy"):
        assert attributes[f"{package}_version"][0].isdigit()
    assert attributes["stopped"] == ""


def test_round_trip_keeps_every_bit(dataset: xr.Dataset, tmp_path: Path) -> None:
    path = save(dataset, tmp_path / "new" / "folder" / "run.nc")
    again = load(path)
    assert again.identical(dataset)
    for name, variable in dataset.variables.items():
        assert again[name].dtype == variable.dtype, name
        assert again[name].attrs == variable.attrs, name
    assert again.attrs == dataset.attrs
    assert [p.name for p in path.parent.iterdir()] == ["run.nc"]


@pytest.mark.parametrize("stopped", ["the state left chi at t = 0.00 s", None])
def test_an_empty_run_is_a_record_too(stopped: str | None, tmp_path: Path) -> None:
    empty = to_dataset(VehicleHistory(PROBLEM, stopped=stopped), {"seed": 1})
    again = load(save(empty, tmp_path / "empty.nc"))
    assert again.identical(empty)
    assert again.sizes["time"] == again.sizes["learn_time"] == 0
    assert again.attrs["stopped"] == (stopped or "")


def test_a_run_without_learner_is_a_record_too(tmp_path: Path) -> None:
    alone = VehicleHistory(PROBLEM, time=[0.0, 0.02], zeta=[np.ones(12)] * 2, tau_b=[np.ones(6)] * 2)
    alone.u_control, alone.disturbance = [np.ones(6)] * 2, [np.ones(6)] * 2
    alone.cost, alone.attenuated = [0.0, 1.0], [0.0, 0.5]
    written = to_dataset(alone, {})
    assert load(save(written, tmp_path / "alone.nc")).identical(written)


def test_saving_again_replaces_the_file(dataset: xr.Dataset, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    save(dataset, path)
    save(dataset.assign_attrs(seed=2), path)
    assert load(path).attrs["seed"] == 2


def cuts(size: int) -> list[int]:
    """Return lengths all over a file, most of them near its ends."""
    near = [0, 1, 7, 8, 64, 100, 511, 512, 800, 2048]
    return [*near, *(int(size * i / 40) for i in range(1, 40)), *(size - n for n in (1, 8, 100))]


def test_truncated_files_are_refused(dataset: xr.Dataset, tmp_path: Path, one_sentence: Check) -> None:
    whole = save(dataset, tmp_path / "run.nc").read_bytes()
    path = tmp_path / "cut.nc"
    for length in cuts(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match="can't be read as a record") as caught:
            load(path)
        one_sentence(caught.value)


@pytest.mark.slow
def test_damaged_files_are_refused_or_read(dataset: xr.Dataset, tmp_path: Path) -> None:
    """A flipped byte may go unnoticed in the data, but never ends in another kind of error."""
    whole = bytearray(save(dataset, tmp_path / "run.nc").read_bytes())
    path = tmp_path / "damaged.nc"
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(40):
        damaged = whole.copy()
        start = int(rng.integers(0, len(whole) - 64))
        damaged[start : start + 64] = bytes(rng.integers(0, 256, 64, dtype=np.uint8))
        path.write_bytes(damaged)
        try:
            load(path)
        except InputError:
            refused += 1
    assert refused > 5


@pytest.mark.parametrize("content", [b"", b"not a record", b"\x89HDF\r\n\x1a\n", b"CDF\x01junk"])
def test_other_files_are_refused(content: bytes, tmp_path: Path, one_sentence: Check) -> None:
    path = tmp_path / "run.nc"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(path) in one_sentence(caught.value)


@pytest.mark.parametrize("name", ["missing.nc", "."])
def test_missing_files_are_named(name: str, tmp_path: Path, one_sentence: Check) -> None:
    with pytest.raises(InputError, match="there is no record") as caught:
        load(tmp_path / name)
    one_sentence(caught.value)


@pytest.mark.parametrize("where", ["a file", "below a file", "a folder"])
def test_unwritable_places_are_refused(
    where: str, dataset: xr.Dataset, tmp_path: Path, one_sentence: Check
) -> None:
    """As root every folder is writable, so a file stands in the way of it."""
    in_the_way = tmp_path / "taken"
    if where == "a folder":
        in_the_way.mkdir()
        (in_the_way / "content").touch()
        path = in_the_way
    else:
        in_the_way.write_text("kept", encoding="utf-8")
        path = in_the_way / ("run.nc" if where == "a file" else "deeper/run.nc")
    with pytest.raises(InputError, match="can't be written") as caught:
        save(dataset, path)
    assert "--out" in one_sentence(caught.value)
    assert where == "a folder" or in_the_way.read_text(encoding="utf-8") == "kept"
    assert not list(tmp_path.glob(".*"))


def test_full_disk_leaves_the_old_record(
    dataset: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_sentence: Check
) -> None:
    path = save(dataset, tmp_path / "run.nc")
    before = path.read_bytes()

    def half(target: Path, content: bytes) -> int:
        with target.open("wb") as file:
            file.write(content[: len(content) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", half)
    with pytest.raises(InputError, match="No space left on device") as caught:
        save(dataset.assign_attrs(seed=2), path)
    one_sentence(caught.value)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]


def test_a_write_that_the_system_stops_leaves_the_old_record(
    dataset: xr.Dataset, tmp_path: Path, one_sentence: Check
) -> None:
    """However it is written: no file may grow beyond half of what is needed."""
    path = save(dataset, tmp_path / "run.nc")
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) // 2, hard))
    try:
        with pytest.raises(InputError, match="can't be written") as caught:
            save(dataset.assign_attrs(seed=2), path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    one_sentence(caught.value)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interrupted_write_leaves_the_old_file(error: type[BaseException], tmp_path: Path) -> None:
    path = write_text(tmp_path / "table.csv", "old")
    with pytest.raises(error), written_whole(path) as temporary:  # noqa: PT012
        temporary.write_text("half of the n", encoding="utf-8")
        raise error
    assert path.read_text(encoding="utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["table.csv"]


def test_last_weights_of_a_record(dataset: xr.Dataset, tmp_path: Path) -> None:
    weights = load_weights(save(dataset, tmp_path / "run.nc"))
    np.testing.assert_array_equal(weights, history().critic[-1])
    assert weights.dtype == np.float64


@pytest.mark.parametrize("kind", ["no learning steps", "another dataset"])
def test_records_without_weights_are_refused(kind: str, tmp_path: Path, one_sentence: Check) -> None:
    path = tmp_path / "run.nc"
    if kind == "another dataset":
        save(xr.Dataset({"x": ("time", [1.0])}), path)
    else:
        save(to_dataset(VehicleHistory(PROBLEM), {}), path)
    with pytest.raises(InputError, match="holds no learned weights") as caught:
        load_weights(path)
    one_sentence(caught.value)


def test_weights_that_are_not_finite_are_refused(
    dataset: xr.Dataset, tmp_path: Path, one_sentence: Check
) -> None:
    """The record of a run that broke down is no start for another one."""
    dataset["critic"][-1, 5] = np.nan
    with pytest.raises(InputError) as caught:
        load_weights(save(dataset, tmp_path / "run.nc"))
    one_sentence(caught.value)


def test_a_run_goes_on_from_a_record(dataset: xr.Dataset, tmp_path: Path) -> None:
    path = save(dataset, tmp_path / "run.nc")
    weights: Array = history().critic[-1]
    again = quick_scenario("simulation.duration=0.1", f'learner.weights="{path}"')
    np.testing.assert_array_equal(again.initial_weights(), weights)
    first = run(again)
    np.testing.assert_array_equal(first.critic[0], weights)
    half = quick_scenario(
        "simulation.duration=0.1", f'learner.weights="{path}"', "learner.weight_factor=0.5"
    )
    np.testing.assert_allclose(half.initial_weights(), 0.5 * weights)


def test_weights_of_another_basis_are_refused(tmp_path: Path, one_sentence: Check) -> None:
    five = [np.ones(5)]
    other = VehicleHistory(PROBLEM, learn_time=[0.0], critic=five, actor_1=five, actor_2=five)
    other.bellman_error, other.sample_error = [0.0], [0.0]
    other.projecting, other.fallback, other.linear = [False], [False], [False]
    other.predicted_cost, other.accepted = [1.0], [1.0]
    path = save(to_dataset(other, {}), tmp_path / "other.nc")
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, f'learner.weights="{path}"'])
    with pytest.raises(InputError, match=r"holds 5 weights, but basis 'quadratic' has 78") as caught:
        scenario.initial_weights()
    one_sentence(caught.value)
