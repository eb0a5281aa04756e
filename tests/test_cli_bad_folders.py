"""Folders that can't be written, disks that are full, and records that are kept whole."""

from __future__ import annotations

import os
import resource
import shutil
from pathlib import Path

import pytest
from stationkeep.comparison.records import runs
from stationkeep.online import load
from stationkeep.symbolic import InputError

from .commands import LOOSE, QUICK, ROUGH, call, files_in, run, sets
from .games import quick_scenario

Capture = pytest.CaptureFixture[str]
SHORT = sets(*QUICK, "simulation.duration=0.3")


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "user"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the record of a short run with the quadratic basis."""
    path = tmp_path_factory.mktemp("finished") / "learned.nc"
    runs.online_record(quick_scenario("simulation.duration=0.3"), path)
    return path


@pytest.mark.parametrize("command", ["online", "offline", "compare"])
@pytest.mark.parametrize("out", ["taken", "taken/further"])
def test_a_file_in_place_of_the_folder(
    command: str, out: str, user_folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is noticed before a run of a minute is made for nothing."""

    def refuse(*_: object, **__: object) -> None:
        pytest.fail("the run was made before the folder of the results was looked at")

    monkeypatch.setattr(runs, "closed_loop", refuse)
    monkeypatch.setattr(runs, "optimum_to_dataset", refuse)
    (user_folder / "taken").write_text("mine", encoding="utf-8")
    answer = call(capsys, command, "--quiet", "--out", out, *SHORT, *sets(*ROUGH))
    assert answer.code == 2
    text = answer.sentence()
    for word in (f"'{out}'", "can't be written", "--out"):
        assert word in text, text
    assert (user_folder / "taken").read_text(encoding="utf-8") == "mine"
    assert files_in(user_folder) == ["taken"]


@pytest.mark.parametrize("command", ["online", "offline"])
def test_what_a_user_keeps_in_the_folder_is_left_alone(
    command: str, user_folder: Path, capsys: Capture
) -> None:
    names = ("probe", "probe.tmp", "test", "tmp", ".probe", "learned.nc.tmp", "notes.txt")
    for name in names:
        (user_folder / name).write_text("mine", encoding="utf-8")
    rough = sets(*ROUGH, *LOOSE)
    answer = call(capsys, command, "--quiet", "--json", "--out", ".", *SHORT, *rough)
    assert answer.code == 0
    for name in names:
        assert (user_folder / name).read_text(encoding="utf-8") == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(user_folder: Path, capsys: Capture) -> None:
    locked = user_folder / "locked"
    locked.mkdir(mode=0o500)
    answer = call(capsys, "online", "--quiet", "--out", "locked", *SHORT)
    assert answer.code == 2
    assert "can't be written (Permission denied)" in answer.sentence()


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="there is no /proc")
def test_a_folder_that_nobody_can_write(capsys: Capture) -> None:
    answer = call(capsys, "online", "--quiet", "--out", "/proc/stationkeep", *SHORT)
    assert answer.code == 2
    assert "can't be written" in answer.sentence()


@pytest.mark.slow
@pytest.mark.parametrize("command", ["online", "offline"])
def test_a_full_disk(command: str, record: Path, user_folder: Path) -> None:
    """No file may grow beyond 10 kB: a record doesn't fit, but says so and leaves nothing."""
    assert record.stat().st_size > 15_000

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))

    words = (command, "--quiet", "--json", *SHORT, *sets(*ROUGH))
    answer = run(*words, cwd=user_folder, preexec_fn=limit)
    assert answer.code == 2, answer.err[-300:]
    assert "can't be written (File too large)" in answer.sentence()
    assert files_in(user_folder) == []


@pytest.mark.slow
def test_a_disk_that_fills_up_keeps_the_older_record(record: Path, user_folder: Path) -> None:
    (user_folder / "out").mkdir()
    kept = shutil.copy(record, user_folder / "out" / "learned.nc")
    before = Path(kept).read_bytes()

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))

    words = ("online", "--quiet", "--out", "out", *SHORT, "--set", "samples.seed=2")
    assert run(*words, cwd=user_folder, preexec_fn=limit).code == 2
    assert Path(kept).read_bytes() == before
    assert files_in(user_folder) == ["out/learned.nc"]


def test_a_record_that_is_broken_is_made_again(
    record: Path, user_folder: Path, capsys: Capture
) -> None:
    (user_folder / "out").mkdir()
    broken = user_folder / "out" / "learned.nc"
    broken.write_bytes(record.read_bytes()[:15_000])
    with pytest.raises(InputError, match="can't be read as a record"):
        load(broken)
    answer = call(capsys, "online", "--quiet", "--json", "--out", "out", *SHORT)
    assert answer.code == 0
    assert answer.err == ""
    assert load(broken).attrs["stopped"] == ""
