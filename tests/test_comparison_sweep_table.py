"""The journal of a sweep, whatever became of its last line, and the tables that are made from it."""

from __future__ import annotations

import csv
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison.merit import Regret
from stationkeep.comparison.sweep import summary
from stationkeep.comparison.sweep.sweep_table import BLOCK, Journal, write_csv, write_netcdf

UNITS = {"run": "1", "policy": None, "cost": "cost", "reason": None, "failed": "1"}


def key(number: int) -> str:
    """Return keys whose order is not that of the numbers."""
    return f"{(number * 0x9E3779B97F4A7C15) % 2**64:016x}{number:08x}"


def line(number: int, cost: float = 0.5) -> dict[str, Any]:
    return {"key": key(number), "row": {"cost": cost}}


def found(journal: Journal, *numbers: int) -> list[float | None]:
    """Return the cost of the last line of each, None where there is none."""
    places = [*journal.offsets(key(number) for number in numbers)]
    return [journal.at(place)["row"]["cost"] if place >= 0 else None for place in places]


def written(path: Path, n: int) -> Path:
    journal = Journal(path)
    for number in range(n):
        journal.add(line(number, float(number)))
    journal.close()
    return path


def test_lines_are_found_by_their_keys_and_the_last_one_counts(tmp_path: Path) -> None:
    path = written(tmp_path / "journal", 2 * BLOCK + 3)
    journal = Journal(path)
    numbers = [*range(2 * BLOCK + 3, -1, -1)]
    assert found(journal, *numbers) == [None, *map(float, numbers[1:])]
    journal.add(line(5, 55.0))
    journal.add({"key": key(7), "row": {"cost": 0.0}, "lost": True})
    journal.close()
    again = Journal(path)
    assert found(again, 4, 5, 6, 7) == [4.0, 55.0, 6.0, 7.0], "a run that was lost is no result"
    assert again.broken == 0
    again.close()


def test_lines_that_were_added_are_found_when_it_is_read_again(tmp_path: Path) -> None:
    """As after Ctrl-C between a line and what is known of it."""
    journal = Journal(written(tmp_path / "journal", 2))
    place = journal.add(line(2, 2.0))
    assert found(journal, 0, 2) == [0.0, None]
    journal.read_again()
    assert found(journal, 0, 1, 2) == [0.0, 1.0, 2.0]
    assert [*journal.offsets([key(2)])] == [place]
    assert journal.add(line(3, 3.0)) > place
    journal.close()


def test_wherever_a_kill_tears_the_last_line(tmp_path: Path) -> None:
    whole = written(tmp_path / "whole", 3).read_bytes()
    path = tmp_path / "torn"
    second = whole.index(b"\n", whole.index(b"\n") + 1) + 1
    for size in range(second, len(whole)):
        path.write_bytes(whole[:size])
        journal = Journal(path)
        assert found(journal, 0, 1, 2) == [0.0, 1.0, None]
        journal.add(line(2, 22.0))
        journal.close()
        again = Journal(path)
        assert found(again, 0, 1, 2) == [0.0, 1.0, 22.0]
        assert again.broken == 0
        again.close()


def test_a_line_with_any_byte_changed_is_left_out(tmp_path: Path) -> None:
    whole = written(tmp_path / "whole", 3).read_bytes()
    path = tmp_path / "changed"
    start, end = whole.index(b"\n") + 1, whole.index(b"\n", whole.index(b"\n") + 1)
    for place in range(start, end):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        journal = Journal(path)
        assert found(journal, 0, 1, 2) == [0.0, None, 2.0], place
        assert journal.broken >= 1
        journal.close()


def rows(n: int) -> Iterator[dict[str, Any]]:
    for number in range(n):
        failed = number % 7 == 3
        yield {
            "run": number,
            "policy": ["learned", "linear"][number % 2],
            "cost": None if failed else 0.1 * number,
            "reason": 'π left, "χ"' if failed else "",
            "failed": failed,
        }


def test_both_tables_hold_the_rows(tmp_path: Path) -> None:
    n = 2 * BLOCK + 7
    write_netcdf(tmp_path / "t.nc", UNITS, n, rows(n), {"seed": 3})
    write_csv(tmp_path / "t.csv", [*UNITS], rows(n))
    with xr.open_dataset(tmp_path / "t.nc") as dataset:
        loaded = dataset.load()
    assert loaded.attrs["seed"] == 3
    assert loaded["cost"].attrs["units"] == "cost"
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        table = [*csv.DictReader(file)]
    for i, row in enumerate(rows(n)):
        assert [str(row[name]) if row[name] is not None else "" for name in UNITS] == [
            *table[i].values()
        ]
        for name in ("run", "policy", "reason", "failed"):
            assert loaded[name].values[i] == row[name]
        cost = loaded["cost"].values[i]
        assert np.isnan(cost) if row["cost"] is None else cost == row["cost"]


@pytest.mark.parametrize("name", ["netcdf", "csv"])
def test_a_full_disk_is_a_sentence_and_the_older_table_stays(name: str, tmp_path: Path) -> None:
    """No file may grow beyond 20 kB; HDF5 alone would crash at the end of the process."""
    table = tmp_path / "table"
    table.write_text("older", encoding="utf-8")
    code = (
        "import resource, sys\n"
        "from pathlib import Path\n"
        "from stationkeep.comparison.sweep.sweep_table import write_csv, write_netcdf\n"
        "from stationkeep.symbolic import InputError\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "rows = ({'run': i, 'cost': 0.1 * i} for i in range(20_000))\n"
        f"path, units = Path({str(table)!r}), {{'run': '1', 'cost': ''}}\n"
        "try:\n"
        f"    if {name!r} == 'netcdf':\n"
        "        write_netcdf(path, units, 20_000, rows, {})\n"
        "    else:\n"
        "        write_csv(path, [*units], rows)\n"
        "except InputError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "can't be written (File too large)" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["table"]
    assert table.read_text(encoding="utf-8") == "older"


def peak(n: int, folder: Path) -> int:
    """Return the memory that a journal and both tables of n rows take at most [bytes]."""
    folder.mkdir()
    tracemalloc.start()
    journal = Journal(folder / "journal")
    places = np.array([journal.add({"key": key(row["run"]), "row": row}) for row in rows(n)])
    kept = (journal.at(int(place))["row"] for place in places)
    write_netcdf(folder / "t.nc", UNITS, n, kept, {})
    write_csv(folder / "t.csv", [*UNITS], (journal.at(int(place))["row"] for place in places))
    journal.close()
    found = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found


def test_memory_does_not_grow_with_the_rows(tmp_path: Path) -> None:
    """A row has about 100 bytes of text; of each run only its place may be in memory."""
    peak(10, tmp_path / "warm")
    few, many = peak(2 * BLOCK, tmp_path / "few"), peak(12 * BLOCK, tmp_path / "many")
    assert many - few < 10 * BLOCK * 60


def test_the_summary_is_the_distribution_of_each_group() -> None:
    rng = np.random.default_rng(1)
    table = [
        {
            "policy": policy,
            "game.gamma": gamma,
            "failed": i == 4 and policy == "learned",
            **dict(
                zip(("regret", "position_rms", "energy", "policy_mean"), rng.random(4), strict=True)
            ),
            "rest_share": 0.01 if i == 0 else 0.0,
        }
        for gamma in (1.5, 2.0)
        for i in range(9)
        for policy in ("learned", "linear")
    ]
    groups = summary(table, ["game.gamma"])
    names = [(group["settings"]["game.gamma"], group["policy"]) for group in groups]
    assert names == [(1.5, "learned"), (1.5, "linear"), (2.0, "learned"), (2.0, "linear")]
    for (gamma, policy), group in zip(names, groups, strict=True):
        mine = [row for row in table if (row["game.gamma"], row["policy"]) == (gamma, policy)]
        whole = [row for row in mine if not row["failed"]]
        known = Regret.of([None if row["failed"] else row["regret"] for row in mine])
        assert group["regret"] == known.as_json()
        assert (group["n"], group["failed"], group["too_short"]) == (9, 9 - len(whole), 1)
        assert group["energy"] == np.median([row["energy"] for row in whole])
    for learned, linear in (groups[:2], groups[2:]):
        ratio = learned["regret"]["median"] / linear["regret"]["median"]
        assert learned["of_linear"]["median"] == pytest.approx(ratio)
        assert learned["regret"]["max"] is learned["of_linear"]["max"] is None, "one of them failed"
        assert linear["of_linear"] == {"median": 1.0, "p90": 1.0, "max": 1.0}


@pytest.mark.parametrize(
    ("optimum", "diverged", "words"),
    [(2.0, 3, "3 of 3 runs ended early"), (None, 0, "no run with an optimum")],
)
def test_a_group_whose_runs_all_failed_has_no_finite_regret(
    optimum: float | None, diverged: int, words: str
) -> None:
    """Without an optimum, as in `disturbed` mode or for a γ that admits none, nothing was compared."""
    names = ("regret", "position_rms", "energy", "policy_mean", "rest_share")
    row = dict.fromkeys(names) | {"policy": "pid", "failed": True, "optimum": optimum}
    (group,) = summary([row] * 3, [])
    assert [group["regret"][name] for name in ("median", "p90", "max")] == [None] * 3
    assert (group["failed"], group["regret"]["diverged"]) == (3, diverged)
    assert words in group["regret"]["note"]
