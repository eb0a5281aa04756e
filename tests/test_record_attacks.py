"""A record from a stranger: what it points to stays closed, what it asks for is summed first."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped]
import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Scenario, replay
from stationkeep.comparison.records import contender_record, online_record
from stationkeep.online import load, save
from stationkeep.online.records import read_parts
from stationkeep.symbolic import InputError

Check = Callable[[BaseException], str]
PROBLEM = "from stationkeep.symbolic import two_state_game\nproblem = two_state_game()\n"
SECRET = np.array([3.0, 1.0, 4.0])


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("record")
    (folder / "plant.py").write_text(PROBLEM)
    sets = ("samples.number=20", "simulation.duration=0.6")
    online_record(Scenario.load(f"{folder}/plant.py:problem", sets), folder / "run.nc")
    return folder / "run.nc"


@pytest.fixture
def copy(record: Path, tmp_path: Path) -> Path:
    path = tmp_path / "run.nc"
    path.write_bytes(record.read_bytes())
    return path


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """A file of numbers that the reader may read, the record's author not."""
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["data"] = SECRET
    (tmp_path / "secret.bin").write_bytes(SECRET.tobytes())
    return tmp_path / "secret.h5"


def external_link(file: Any, secret: Path) -> None:
    file["stolen"] = h5py.ExternalLink(str(secret), "/data")


def soft_link(file: Any, secret: Path) -> None:
    file["stolen"] = h5py.SoftLink("/zeta")


def external_storage(file: Any, secret: Path) -> None:
    raw = (str(secret.with_suffix(".bin")), 0, SECRET.nbytes)
    file.create_dataset("stolen", (3,), "f8", external=[raw])


def virtual(file: Any, secret: Path) -> None:
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource(str(secret), "data", (3,))
    file.create_virtual_dataset("stolen", layout)


def group(file: Any, secret: Path) -> None:
    file.create_group("stolen")["data"] = h5py.ExternalLink(str(secret), "/data")


def huge(file: Any, secret: Path) -> None:
    file.create_dataset("stolen", (2**40,), "f8")


def huge_chunks(file: Any, secret: Path) -> None:
    file.create_dataset("stolen", (2**36,), "f8", chunks=(2**20,), compression="gzip")


def unknown_filter(file: Any, secret: Path) -> None:
    created = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    created.set_chunk((3,))
    created.set_filter(32015, h5py.h5z.FLAG_OPTIONAL)
    kind, space = h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((3,))
    h5py.h5d.create(file.id, b"stolen", kind, space, created)


@pytest.mark.parametrize(
    ("attack", "words"),
    [
        (external_link, "is a link"),
        (soft_link, "is a link"),
        (external_storage, "lie in another file"),
        (virtual, "lie in another file"),
        (group, "no variable"),
        (huge, "GiB"),
        (huge_chunks, "GiB"),
        (unknown_filter, "filter"),
    ],
)
def test_what_points_out_of_the_file_or_is_too_large_is_refused(
    attack: Callable[[Any, Path], None], words: str, copy: Path, secret: Path, one_sentence: Check
) -> None:
    with h5py.File(copy, "a") as file:
        attack(file, secret)
    for read in (load, replay, read_parts):
        with pytest.raises(InputError) as caught:
            read(copy)  # type: ignore[operator]
        assert words in one_sentence(caught.value)
        assert "stolen" in str(caught.value) or "GiB" in str(caught.value)


def test_other_tools_read_it_and_their_files_are_read(copy: Path, tmp_path: Path) -> None:
    """xarray opens the same numbers; what it writes again, compressed too, is the same here."""
    ours = load(copy)
    with xr.open_dataset(copy, engine="h5netcdf") as dataset:
        theirs = dataset.load()
    xr.testing.assert_identical(ours, theirs)
    assert [theirs[name].dtype for name in ours.variables] == [ours[n].dtype for n in ours.variables]
    packed = {name: {"zlib": True, "complevel": 4} for name in ("zeta", "critic")}
    theirs.to_netcdf(tmp_path / "again.nc", engine="h5netcdf", encoding=packed)
    xr.testing.assert_identical(load(tmp_path / "again.nc"), ours)
    assert replay(tmp_path / "again.nc").verdict == "bit-equal"


def test_a_shell_command_in_an_expression_is_no_operation(copy: Path, tmp_path: Path) -> None:
    """A serialised CasADi function names the compiler it is built with; a record's is instructions."""
    mark = tmp_path / "ran"
    record = load(copy)
    text = str(record.attrs["problem"])
    assert '"drift"' in text
    for poison in (f"; touch {mark}", f"__import__('os').system('touch {mark}')"):
        poisoned = record.copy()
        poisoned.attrs["problem"] = text.replace('"mul"', f'"{poison}"', 1).replace(
            '"sq"', f'"{poison}"', 1
        )
        save(poisoned, copy)
        with pytest.raises(InputError):
            replay(copy)
        assert not mark.exists()


@pytest.mark.parametrize("seed", range(4))
def test_flipped_bits_are_read_or_refused_in_one_sentence(
    seed: int, copy: Path, one_sentence: Check
) -> None:
    whole = copy.read_bytes()
    rng = np.random.default_rng(seed)
    for _ in range(25):
        damaged = bytearray(whole)
        damaged[int(rng.integers(len(whole)))] ^= 1 << int(rng.integers(8))
        copy.write_bytes(damaged)
        try:
            load(copy)
        except InputError as error:
            one_sentence(error)


def test_a_name_that_is_no_text_is_refused(copy: Path, one_sentence: Check) -> None:
    """As one flipped bit makes it of an attribute's name."""
    with h5py.File(copy, "a") as file:
        name = b"mod\xe5"
        space = h5py.h5s.create(h5py.h5s.SCALAR)
        h5py.h5a.create(file.id, name, h5py.h5t.NATIVE_INT32, space)
    with pytest.raises(InputError, match="can't be read") as caught:
        load(copy)
    one_sentence(caught.value)


def test_a_damaged_record_is_made_again(record: Path, copy: Path) -> None:
    scenario = Scenario.load(f"{record.parent}/plant.py:problem", ["simulation.duration=0.6"])
    first = contender_record(scenario, "linear", copy.with_name("linear.nc"))
    damaged = bytearray(copy.with_name("linear.nc").read_bytes())
    damaged[100:400] = bytes(300)
    copy.with_name("linear.nc").write_bytes(damaged)
    again = contender_record(scenario, "linear", copy.with_name("linear.nc"))
    np.testing.assert_array_equal(first["zeta"], again["zeta"])
    np.testing.assert_array_equal(load(copy.with_name("linear.nc"))["zeta"], first["zeta"])
