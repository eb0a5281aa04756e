"""Ctrl-C: exit code 1, no traceback, no temporary files, and a record that is whole or not there."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import casadi
import pytest
from stationkeep.online import Learner, Monitor, load
from stationkeep.online.vehicle import HeldPlant

from .commands import COARSE, QUICK, Answer, call, files_in, script, sets

Capture = pytest.CaptureFixture[str]
LONG = sets(*QUICK, "samples.number=1000", "simulation.duration=2000")


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def interrupted(
    *arguments: str, cwd: Path, ready: Callable[[], bool], after: float, timeout: float = 60.0
) -> Answer:
    """Start the script, press Ctrl-C once `after` seconds have passed since it was ready."""
    process = subprocess.Popen(
        [script(), *arguments],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )
    try:
        end = time.monotonic() + timeout
        while not ready() and process.poll() is None and time.monotonic() < end:
            time.sleep(0.02)
        time.sleep(after)
        assert process.poll() is None, "it was over before Ctrl-C"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=timeout)
    finally:
        process.kill()
        process.wait()
    return Answer(process.returncode, out, err)


def test_ctrl_c_during_online(user_folder: Path) -> None:
    answer = interrupted(
        "online", "--json", "--quiet", "--out", "out", *LONG,
        cwd=user_folder, ready=lambda: True, after=3.0,
    )  # fmt: skip
    assert answer.code == 1
    assert answer.out == ""
    assert answer.sentence().startswith("interrupted")
    assert files_in(user_folder) in ([], ["out/learned.nc"])
    if files_in(user_folder):
        record = load(user_folder / "out" / "learned.nc")
        assert str(record.attrs["stopped"]).startswith("interrupted at t = ")
        # it may have come before the first step was done
        assert all(0.0 <= t < 2000.0 for t in record["time"].values)
        assert record["critic"].shape == (record.sizes["learn_time"], 78)


@pytest.mark.slow
def test_ctrl_c_during_compare_keeps_the_finished_records(user_folder: Path) -> None:
    records = user_folder / "out" / "records"
    answer = interrupted(
        "compare", "--json", "--quiet", "--out", "out", *sets(*QUICK, *COARSE),
        cwd=user_folder, ready=(records / "linear.nc").exists, after=0.0,
    )  # fmt: skip
    assert answer.code == 1
    assert answer.out == ""
    assert answer.sentence().startswith("interrupted")
    assert not [name for name in files_in(user_folder) if Path(name).name.startswith(".")]
    assert not (user_folder / "out" / "report.html").exists(), "it went on to the end"
    for name in ("learned", "linear"):
        record = load(records / f"{name}.nc")
        assert record.attrs["stopped"] == ""
        assert record["time"].values[-1] == pytest.approx(2.0)


INTERRUPTIONS = [
    (HeldPlant, "advance", 30),
    (HeldPlant, "rates", 50),
    (Learner, "step", 3),
    (Monitor, "sample", 1),
    (Monitor, "sample", 2),
    (Learner, "policies", 20),
]


@pytest.mark.parametrize(("owner", "name", "call_number"), INTERRUPTIONS)
def test_wherever_a_run_is_interrupted_its_record_is_whole(
    owner: type,
    name: str,
    call_number: int,
    user_folder: Path,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    words = ("online", "--json", "--quiet", "--out", "out", *sets(*QUICK))
    original = getattr(owner, name)
    calls = 0

    def interrupting(*arguments: object, **named: object) -> object:
        nonlocal calls
        calls += 1
        if calls == call_number:
            raise KeyboardInterrupt
        return original(*arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(owner, name, interrupting)
        answer = call(capsys, *words)
    assert calls >= call_number
    assert answer.code == 1
    assert answer.out == ""
    assert answer.sentence().startswith("interrupted")
    record = load(user_folder / "out" / "learned.nc")
    assert str(record.attrs["stopped"]).startswith("interrupted at t = ")
    assert record["time"].values[-1] < 2.0
    again = call(capsys, *words)
    assert again.code == 0, "what was interrupted is made again"
    assert load(user_folder / "out" / "learned.nc")["time"].values[-1] == pytest.approx(2.0)


PRESSING = """
import signal

def size1(self, *arguments):
    if not pressed:
        pressed.append(True)
        signal.raise_signal(signal.SIGINT)
    return original(self, *arguments)
"""


def test_ctrl_c_while_expressions_are_built(
    user_folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """CasADi calls Python back while it looks at arguments, and swallows what is raised there."""
    owner = next(base for base in casadi.SX.__mro__ if "size1" in vars(base))
    pressed: list[bool] = []
    # as if it were a line of CasADi's own module, where the signal finds the interpreter
    place = {"__name__": "casadi.casadi", "original": owner.size1, "pressed": pressed}
    exec(compile(PRESSING, casadi.casadi.__file__, "exec"), place)
    monkeypatch.setattr(owner, "size1", place["size1"])
    answer = call(capsys, "online", "--json", "--quiet", "--out", "out", *sets(*QUICK))
    assert pressed == [True]
    assert answer.code == 1, "Ctrl-C was lost"
    assert answer.sentence().startswith("interrupted")
    if files_in(user_folder):
        record = load(user_folder / "out" / "learned.nc")
        assert record.attrs["stopped"], "Ctrl-C was noticed only when everything was done"


@pytest.mark.parametrize("module", ["pydantic", "casadi", "scipy", "rich"])
def test_ctrl_c_while_modules_are_loaded(module: str, user_folder: Path) -> None:
    code = (
        "import signal, sys\n"
        "class Press:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            sys.meta_path.remove(self)\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Press())\n"
        "from stationkeep.cli.main import main\n"
        f"sys.exit(main(['check', *{sets(*QUICK)!r}]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=user_folder, capture_output=True, text=True)
    assert done.returncode == 1
    assert Answer(done.returncode, done.stdout, done.stderr).sentence().startswith("interrupted")
