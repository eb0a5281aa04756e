"""Help, start-up, reserved commands, tables, and a machine without a compiler."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from stationkeep.cli.main import COMMANDS, RECORD_COMMANDS, parser

from .commands import QUICK, Answer, call, run, script, sets

README = Path(__file__).resolve().parents[1] / "README.md"
HEAVY = ("casadi", "numpy", "scipy", "xarray", "pydantic", "matplotlib", "rich")


@pytest.fixture(autouse=True)
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def python(code: str, cwd: Path) -> Answer:
    done = subprocess.run([sys.executable, "-c", code], cwd=cwd, capture_output=True, text=True)
    return Answer(done.returncode, done.stdout, done.stderr)


def test_help_lists_the_commands(tmp_path: Path) -> None:
    answer = run("--help", cwd=tmp_path)
    assert answer.code == 0
    assert answer.err == ""
    for command in COMMANDS:
        assert re.search(rf"^ +{command} +\w+", answer.out, re.MULTILINE)


def test_help_imports_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from stationkeep.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit as stop:\n    assert stop.code == 0\n"
        f"print('loaded:', [name for name in {HEAVY} if name in sys.modules])\n"
    )
    answer = python(code, tmp_path)
    assert answer.code == 0, answer.err
    assert answer.out.endswith("loaded: []\n")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = call(capsys, command, "--help")
    assert answer.code == 0
    given = ("RECORD",) if command in RECORD_COMMANDS else ("--set", "bluerov2-heavy")
    for option in ("--out", "--json", "--quiet", *given):
        assert option in answer.out


def test_the_module_runs_as_the_script_does(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "stationkeep.cli.main", "replay"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == run("replay", cwd=tmp_path).err


def test_commands_of_the_readme_are_commands() -> None:
    text = README.read_text(encoding="utf-8")
    blocks = "\n".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
    lines = re.findall(r"stationkeep (\w+.*)$", blocks, re.MULTILINE)
    assert {line.split()[0] for line in lines} >= {"generate", "online", "offline", "compare"}
    for line in lines:
        assert parser().parse_args(shlex.split(line, comments=True)).command in COMMANDS


def test_tables_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    answer = call(capsys, "check", "--quiet", *sets(*QUICK))
    assert answer.code == 0
    assert answer.err == ""
    for words in ("(26) as printed", "(26) corrected", "Assumption 2", "holds"):
        assert words in answer.out


def test_square_brackets_of_units_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    answer = call(capsys, "online", "--quiet", *sets(*QUICK, "simulation.duration=0.1"))
    assert answer.code == 0
    assert "[cost/s]" in answer.out
    assert "results/bluerov2-heavy/learned.nc" in answer.out


def test_without_a_compiler_everything_works_and_says_so_once(tmp_path: Path) -> None:
    empty, cache = tmp_path / "bin", tmp_path / "cache"
    empty.mkdir()
    env = {key: value for key, value in os.environ.items() if key != "CC"}
    env |= {"PATH": str(empty), "STATIONKEEP_CACHE": str(cache)}
    settings = sets(*QUICK, "samples.number=100", "simulation.duration=0.2")
    answer = run("online", "--json", "--quiet", *settings, cwd=tmp_path, env=env)
    assert answer.code == 0
    assert answer.json()["stopped"] is None
    text = answer.sentence()
    assert "compiler" in text
    assert "virtual machine" in text
    assert not cache.exists()


@pytest.mark.slow
@pytest.mark.parametrize("form", [["--json"], []])
def test_a_terminal_that_knows_only_ascii(form: list[str], tmp_path: Path) -> None:
    env = os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    answer = run("check", "--quiet", *form, *sets(*QUICK), cwd=tmp_path, env=env)
    assert answer.code == 0, answer.err
    assert answer.err == ""
    assert not form or answer.json()["conditions"]


def test_a_closed_pipe_is_no_crash(tmp_path: Path) -> None:
    command = f"{shlex.join([script(), 'generate', '--help'])} | true; "
    command += f"{shlex.join([script(), 'check', '--quiet', *sets(*QUICK)])} | head -c 1 >&2"
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    assert "BrokenPipeError" not in done.stderr
