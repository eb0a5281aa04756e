"""`--json`: one object on stdout, nothing else there, with the keys that scripts rely on."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.online import load

from .commands import LOOSE, QUICK, ROUGH, Answer, files_in, run, sets

FUNCTIONS = {"drift", "input_matrix", "drift_jacobian", "input_matrix_jacobian", "sample_kernel"}
CERTIFICATE = {"value_error", "defect", "hji_residual", "costate_error", "horizon_error"}
STATE = "0.3,0,0,0,0,0,0,0,0,0,0,0"


def is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def are_numbers(values: object, n: int) -> bool:
    return isinstance(values, list) and len(values) == n and all(map(is_number, values))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder that the commands of this file run in."""
    return tmp_path_factory.mktemp("user")


@pytest.fixture(scope="module")
def generated(folder: Path) -> tuple[Answer, Answer]:
    """Return `generate`, and the same again."""
    arguments = ("generate", "--json", "--quiet", *sets(*QUICK))
    return run(*arguments, cwd=folder), run(*arguments, cwd=folder)


@pytest.fixture(scope="module")
def online(folder: Path) -> Answer:
    return run("online", "--json", "--out", "learned", *sets(*QUICK), cwd=folder)


@pytest.fixture(scope="module")
def offline(folder: Path) -> Answer:
    states = ("--state", STATE, "--state", f"-{STATE}")
    return run("offline", "--json", "--quiet", *states, *sets(*QUICK, *ROUGH, *LOOSE), cwd=folder)


@pytest.fixture(scope="module")
def checked(folder: Path) -> Answer:
    return run("check", "--json", "--quiet", *sets(*QUICK), cwd=folder)


def test_generate(generated: tuple[Answer, Answer]) -> None:
    first, again = generated
    assert first.code == 0
    answer = first.json()
    assert {"functions", "cache_hit", "seconds"} <= set(answer)
    assert {row["name"] for row in answer["functions"]} >= FUNCTIONS
    for row in answer["functions"]:
        assert isinstance(row["name"], str)
        assert row["inputs"]
        assert row["outputs"]
        assert all(isinstance(text, str) for text in (*row["inputs"], *row["outputs"]))
        assert isinstance(row["operations"], int)
        assert row["operations"] > 0
        assert row["compiled"] is True
        assert 0.0 <= row["max_difference"] <= 1e-12
    assert is_number(answer["seconds"])
    assert isinstance(answer["cache_hit"], bool)
    assert again.json()["cache_hit"] is True
    assert again.json()["seconds"] < 60.0


def test_generate_names_shapes(generated: tuple[Answer, Answer]) -> None:
    rows = {row["name"]: row for row in generated[0].json()["functions"]}
    assert rows["drift"]["inputs"] == ["zeta[12]"]
    assert rows["input_matrix"]["outputs"] == ["g[12x6]"]
    assert rows["sample_kernel"]["inputs"] == ["points[12x200]"]


def test_online(online: Answer) -> None:
    assert online.code == 0
    answer = online.json()
    assert set(answer["weights"]) == {"critic", "actor_1", "actor_2"}
    assert all(are_numbers(weights, 78) for weights in answer["weights"].values())
    assert are_numbers(answer["final_state"], 12)
    for key in ("bellman_error", "rank_margin", "cost", "real_time_factor"):
        assert is_number(answer[key]), key
    for key in ("row_margin", "row_rank", "regressor", "actor_norm", "actor_distance"):
        assert is_number(answer[key]), key
    assert answer["rank_margin"] > 0.0
    assert answer["real_time_factor"] > 0.0
    assert answer["stopped"] is None


def test_online_keeps_the_record_that_it_names(online: Answer, folder: Path) -> None:
    answer = online.json()
    record = load(folder / answer["record"])
    np.testing.assert_array_equal(record["critic"].values[-1], answer["weights"]["critic"])
    assert answer["rank_margin"] == record["rank_margin"].values.min()
    assert answer["regressor"] == record["regressor"].values.max()
    np.testing.assert_array_equal(record["zeta"].values[-1], answer["final_state"])
    assert record["time"].values[-1] == pytest.approx(2.0)
    for variable in record.variables.values():
        labels = (("state",), ("input",), ("force",), ("player",))
        assert variable.dims in labels or variable.attrs["units"]
    assert {"scenario", "seed", "stationkeep_version", "casadi_version"} <= set(record.attrs)


def test_online_cost_is_that_of_the_record(online: Answer, folder: Path) -> None:
    answer = online.json()
    record = load(folder / answer["record"])
    P = Scenario.load("bluerov2-heavy", QUICK).station_keeping().problem.P
    end = record["zeta"].values[-1]
    spent = float(record["cost"].values[-1] - record["attenuated"].values[-1])
    assert answer["cost"] == pytest.approx(spent + end @ P @ end, rel=1e-12)


def test_offline(offline: Answer) -> None:
    assert offline.code == 0
    answer = offline.json()
    assert len(answer["states"]) == 2
    for row in answer["states"]:
        assert are_numbers(row["zeta"], 12)
        assert are_numbers(row["costate"], 12)
        assert are_numbers(row["u_control"], 6)
        assert are_numbers(row["u_disturbance"], 6)
        assert row["value"] > 0.0
        assert set(row["certificate"]) >= CERTIFICATE
        verdicts = {"second_order", "gradient_unique"}
        for name, value in row["certificate"].items():
            assert isinstance(value, bool) if name in verdicts else is_number(value)
        assert row["extremals"] == []
        assert isinstance(row["iterations"], int)
        assert is_number(row["seconds"])
    assert np.array(answer["linear"]["P"]).shape == (12, 12)
    assert answer["linear"]["gamma_star"] == pytest.approx(1.0, abs=1e-6)


def test_offline_from_mirrored_states(offline: Answer) -> None:
    """The vehicle's surge is symmetric, so both directions cost the same and forces are mirrored."""
    ahead, behind = offline.json()["states"]
    assert ahead["zeta"][0] == -behind["zeta"][0] == 0.3
    assert ahead["value"] == pytest.approx(behind["value"], rel=1e-6)
    assert ahead["u_control"][0] == pytest.approx(-behind["u_control"][0], rel=1e-5)


def test_offline_writes_what_it_prints(offline: Answer, folder: Path) -> None:
    results = folder / "results" / "bluerov2-heavy"
    assert files_in(results) == ["offline.csv", "offline.json", "optimal-1.nc", "optimal-2.nc"]
    written = Answer(0, (results / "offline.json").read_text(encoding="utf-8"), "").json()
    assert written == offline.json()


def test_check(checked: Answer) -> None:
    assert checked.code == 0
    conditions: list[dict[str, Any]] = checked.json()["conditions"]
    for row in conditions:
        assert {"name", "paper", "value", "bound", "holds", "note"} <= set(row)
        assert isinstance(row["name"], str)
        assert isinstance(row["paper"], str)
        assert row["value"] is None or is_number(row["value"])
        assert row["bound"] is None or is_number(row["bound"])
        assert row["holds"] in (True, False, None)
        assert row["note"]
    paper = " ".join(row["paper"] for row in conditions)
    for reference in ("Assumption 1", "Property 1", "Assumption 2", "Assumption 3", "(18)"):
        assert reference in paper
    for reference in ("(24)", "(25)", "(26) as printed", "(26) corrected"):
        assert reference in paper


def test_a_value_that_is_not_known_is_null_with_a_note(checked: Answer) -> None:
    unknown = [row for row in checked.json()["conditions"] if row["value"] is None]
    assert unknown
    assert all(row["holds"] is None and len(row["note"]) > 20 for row in unknown)


def test_quiet_leaves_stderr_empty(
    generated: tuple[Answer, Answer], offline: Answer, checked: Answer
) -> None:
    for answer in (*generated, offline, checked):
        assert answer.err == ""


def test_json_has_nothing_else_on_stdout(
    generated: tuple[Answer, Answer], online: Answer, offline: Answer, checked: Answer
) -> None:
    for answer in (*generated, online, offline, checked):
        assert answer.out.startswith("{")
        assert answer.out.endswith("}\n")
        assert answer.out.count("\n") == 1
        assert "NaN" not in answer.out
        assert "Infinity" not in answer.out


def test_stderr_of_a_good_run_is_no_blank_line(online: Answer) -> None:
    """Progress is for a terminal; a log file gets nothing, or lines that say something."""
    assert not online.err or online.err.strip()


def test_check_and_generate_write_nothing(folder: Path, checked: Answer) -> None:
    assert checked.code == 0
    assert not [name for name in files_in(folder) if not name.startswith(("results", "learned"))]
