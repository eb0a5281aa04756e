"""Regret over random states: quantiles with failures, targets, runs that are kept, and the figures."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import Regret
from stationkeep.comparison.parallel import Work
from stationkeep.comparison.policies import LinearPolicy
from stationkeep.online import draw_samples
from stationkeep.symbolic import InputError
from studies.cases import Case, Row, regrets
from studies.kept import Keep, digest, key_of, source_folders
from studies.targets import MOONSHOT, REQUIRED, Target, target

from .games import Array, quick_scenario

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


def test_failures_are_in_every_quantile() -> None:
    finished = [0.01 * k for k in range(1, 8)]
    all_well = Regret.of(reversed(finished))
    assert (all_well.n, all_well.diverged) == (7, 0)
    assert (all_well.median, all_well.max) == (finished[3], finished[6])
    lost = Regret.of([*finished, np.inf])
    assert (lost.n, lost.diverged, lost.max) == (8, 1, np.inf)
    assert lost.median == finished[4]
    assert Regret.of([0.1, np.inf, np.inf]).median == np.inf


def test_a_run_without_cost_or_optimum_is_a_failure() -> None:
    assert Row(2.0, 2.5, None, 1.0, 1.0).regret == pytest.approx(0.25)
    assert Row(2.0, np.inf, "left chi", 1.0, 1.0).regret == np.inf
    assert Row(np.nan, 2.0, "no optimum", 1.0, 1.0).regret == np.inf


def test_targets_are_parts_of_what_the_linear_policy_loses() -> None:
    linear = Regret.of([0.3, 0.3, 0.9])
    limit = Target(1 / 3, 1 / 2)
    for regret, median, largest in ((0.09, True, True), (0.11, False, True), (0.5, False, False)):
        assert limit.met(Regret.of([regret] * 3), linear) == (median, largest)
    assert limit.met(Regret.of([0.0, 0.0, np.inf]), linear) == (True, False)
    # a linear policy that fails excuses nobody
    for regret in (0.1, np.inf):
        assert limit.met(Regret.of([regret]), Regret.of([np.inf])) == (False, False)
        assert limit.met(Regret.of([regret]), Regret.of([])) == (False, False)


@pytest.mark.parametrize(
    ("scale", "required", "moonshot"),
    [
        (0.1, (1 / 3, 1 / 2), (1 / 8, 1 / 5)),
        (0.35, (1 / 3, 1 / 2), (1 / 8, 1 / 5)),
        (0.6, (1 / 3, 1 / 2), (1 / 8, 1 / 5)),
        (1.0, (1 / 2, 2 / 3), (1 / 5, 1 / 3)),
        (1.5, (1 / 2, 2 / 3), (1 / 5, 1 / 3)),
    ],
)
def test_target_of_a_scale(
    scale: float, required: tuple[float, float], moonshot: tuple[float, float]
) -> None:
    assert target(REQUIRED, scale) == Target(*required)
    assert target(MOONSHOT, scale) == Target(*moonshot)


def squares(folder: Path) -> Work[int, dict[str, int]]:
    def work(task: int) -> Iterator[dict[str, int]]:
        with (folder / "worked").open("a") as file:
            file.write(f"{task}\n")
        yield {"square": task * task}

    return work


def worked(folder: Path) -> list[int]:
    return [int(line) for line in (folder / "worked").read_text().split()]


def test_what_was_finished_is_not_done_again(tmp_path: Path) -> None:
    told: list[tuple[int, int, int]] = []
    keep = Keep(tmp_path / "kept" / "a.jsonl", progress=lambda *numbers: told.append(numbers))
    tasks = [3, 1, 2]
    keys = [f"key {task}" for task in tasks]
    first = keep.results(squares, tmp_path, tasks[:2], keys[:2])
    assert first == [{"square": 9}, {"square": 1}]
    assert keep.results(squares, tmp_path, tasks, keys) == [*first, {"square": 4}]
    assert worked(tmp_path) == [3, 1, 2]
    assert told == [(1, 1, 2), (2, 2, 2), (3, 1, 3)]
    assert keep.results(squares, tmp_path, tasks, ["another key", *keys[1:]]) == [*first, {"square": 4}]
    assert worked(tmp_path) == [3, 1, 2, 3]


@pytest.mark.parametrize("left", ['{"key": "key 5", "squ', "[1, 2]", '{"square": 25}', "\xff", ""])
def test_a_line_that_a_killed_process_left_is_done_again(tmp_path: Path, left: str) -> None:
    keep = Keep(tmp_path / "a.jsonl")
    keep.results(squares, tmp_path, [4], ["key 4"])
    with keep.file.open("ab") as file:
        file.write(left.encode("latin-1"))
    both = [{"square": 16}, {"square": 25}]
    for _ in range(2):
        assert keep.results(squares, tmp_path, [4, 5], ["key 4", "key 5"]) == both
    assert worked(tmp_path) == [4, 5]


def test_a_file_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    keep = Keep(tmp_path / "file" / "a.jsonl")
    with pytest.raises(InputError, match=r"can't be written .*choose another folder"):
        keep.results(squares, tmp_path, [4], ["key 4"])


def test_keys_tell_inputs_apart() -> None:
    assert key_of("a", 1) == key_of("a", 1)
    assert len({key_of("a", 1), key_of("a", 2), key_of("a1"), key_of("a", "", 1)}) == 4


def test_keys_tell_sources_apart(tmp_path: Path) -> None:
    """Whatever happens to a source file, however deep, gives another hash; to other files nothing."""
    folders = [tmp_path / "one", tmp_path / "two"]
    deep = folders[0] / "wing" / "deep"
    deep.mkdir(parents=True)
    folders[1].mkdir()
    (deep / "law.py").write_text("x = 1\n")
    (folders[1] / "studies.py").write_text("y = 1\n")
    seen = [digest(folders)]

    def changed() -> bool:
        seen.append(digest(folders))
        return len({*seen}) == len(seen)

    (deep / "law.py").write_text("x = 2\n")
    assert changed()
    (deep / "law.py").rename(deep / "rule.py")
    assert changed()
    (deep / "rule.py").rename(folders[0] / "rule.py")
    assert changed()
    (folders[0] / "rule.py").rename(folders[1] / "rule.py")
    assert changed()
    (deep / "kernel.c").write_text("int main;\n")
    assert changed()
    (folders[1] / "vehicle.toml").write_text("mass = 1\n")
    assert changed()
    (folders[1] / "studies.py").write_text("y = 2\n")
    assert changed()
    (folders[1] / "rule.py").unlink()
    assert changed()
    (deep / "rule.pyc").write_bytes(b"x")
    assert digest(folders) == seen[-1]


def test_the_sources_are_the_package_and_the_studies() -> None:
    """Every module that a study loads lies below a folder whose files are in the keys."""
    folders = [folder.resolve() for folder in source_folders()]
    loaded = [
        Path(module.__file__).resolve()
        for name, module in sys.modules.items()
        if name.split(".")[0] in ("stationkeep", "studies")
        and name != "stationkeep"  # it holds names only
        and not name.startswith("stationkeep.cli")
        and getattr(module, "__file__", None)
    ]
    assert len(loaded) > 100
    assert [path for path in loaded if not any(path.is_relative_to(one) for one in folders)] == []


def test_studies_do_not_load_the_command_line(tmp_path: Path) -> None:
    """Its sources are not in the keys, so nothing of it may take part in a result."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import importlib\n"
        "for name in sys.argv[2:]: importlib.import_module('studies.' + name)\n"
        "print([name for name in sys.modules if name.startswith('stationkeep.cli')])"
    )
    names = [path.stem for path in (BENCHMARKS / "studies").glob("*.py") if path.stem != "__init__"]
    words = [sys.executable, "-B", "-c", code, str(BENCHMARKS), *names]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.stdout, done.stderr) == ("[]\n", "")


@pytest.mark.slow
def test_workers_load_the_studies(tmp_path: Path) -> None:
    """Processes that are spawned find what lies in the folder of a script, and keep what they made."""
    script = tmp_path / "script.py"
    script.write_text(
        "import sys\nfrom pathlib import Path\n"
        f"sys.path.insert(0, {str(BENCHMARKS)!r})\n"  # as for a script that lies there
        "from studies.closed_loops import Run, run_all\n"
        "from stationkeep.comparison import Scenario\n"
        "if __name__ == '__main__':\n"
        "    scenario = Scenario.load()\n"
        "    runs = [Run({'policy': name}, name, {'duration': 0.1}) for name in ('linear', 'lqr')]\n"
        "    rows = run_all(scenario, runs, Path('rows.jsonl'), 2)\n"
        "    print([(row['policy'], row['stopped'], row['seconds']) for row in rows])\n"
    )
    words = [sys.executable, "-B", str(script)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 2
    for name in ("linear", "lqr"):
        assert f"('{name}', None, 0.1" in done.stdout


def test_runs_are_kept_and_failures_counted(tmp_path: Path) -> None:
    """With chi below the states every run ends at once, and none is dropped."""
    scenario = quick_scenario("simulation.duration=0.2")
    states = draw_samples(scenario.station_keeping().envelope, 2, 20)
    made: list[int] = []
    keep = Keep(tmp_path / "runs.jsonl", progress=lambda there, new, total: made.append(total))
    cases = [
        Case("linear", "linear"),
        Case("frozen", learn=False),
        Case("lost", changes={"simulation": {"chi": 1e-3}}),
    ]
    found = regrets(scenario, cases, states, keep)
    assert made == [6] * 6
    # frozen Riccati weights are the linear policy with g of ζ instead of g(0)
    for one, other in zip(found["linear"], found["frozen"], strict=True):
        assert one.value == other.value
        assert one.cost == pytest.approx(other.cost, rel=1e-2)
        assert one.cost != other.cost
        assert one.simulated == pytest.approx(0.2)
    for row in found["lost"]:
        assert row.regret == np.inf
        assert "left chi" in str(row.stopped)
    assert Regret.of(row.regret for row in found["lost"]).diverged == 2
    again = regrets(scenario, cases[::-1], states, keep)
    assert len(made) == 6
    assert again == found
    entries = [json.loads(line) for line in keep.file.read_text().splitlines()]
    np.testing.assert_array_equal([entry["zeta"] for entry in entries[::3]], states)


def test_a_run_that_the_user_ended_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = quick_scenario("simulation.duration=0.2")
    states = draw_samples(scenario.station_keeping().envelope, 2, 20)
    keep = Keep(tmp_path / "runs.jsonl")
    steps = iter(range(1000))

    def interrupted(policy: LinearPolicy, zeta: Array, dt: float) -> Array:
        if next(steps) == 15:
            raise KeyboardInterrupt
        return -policy.gain @ zeta

    with monkeypatch.context() as patch:
        patch.setattr(LinearPolicy, "control", interrupted)
        with pytest.raises(KeyboardInterrupt):
            regrets(scenario, [Case("linear", "linear")], states, keep)
    assert len(keep.file.read_text().splitlines()) == 1
    rows = regrets(scenario, [Case("linear", "linear")], states, keep)["linear"]
    assert [row.stopped for row in rows] == [None, None]


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.35, 1.0])
def test_learning_while_it_is_scored_loses_a_part_of_what_the_linear_policy_loses(
    tmp_path: Path, scale: float
) -> None:
    """A seeded part of the table of `benchmarks/regret.py`, held to what is required of all of it."""
    scenario = Scenario.load("bluerov2-heavy", [f"envelope.scale={scale}"])
    states = draw_samples(scenario.station_keeping().envelope, 8, 20)
    cases = [Case("linear", "linear"), Case("online")]
    found = regrets(scenario, cases, states, Keep(tmp_path / "runs.jsonl"))
    linear, online = (Regret.of(row.regret for row in found[case.name]) for case in cases)
    assert (linear.diverged, online.diverged) == (0, 0)
    # V* is the least there is, found to a few millionths
    assert min(row.regret for rows in found.values() for row in rows) > -1e-5
    assert target(REQUIRED, scale).met(online, linear) == (True, True), (online, linear)
