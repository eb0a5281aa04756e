"""A run of the vehicle beside the theorem: V_L, |Z| and every row that `check --run` adds."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Condition
from stationkeep.comparison.optima import Bounds, Ideal, fit, ideal_record
from stationkeep.comparison.records import online_record
from stationkeep.comparison.report import Page
from stationkeep.comparison.report.monitor_figure import draw_monitor
from stationkeep.comparison.study.analysis import ideal_of
from stationkeep.comparison.theory import Theory, require_run, run_conditions, theory
from stationkeep.offline import Pairs
from stationkeep.online import save
from stationkeep.symbolic import InputError

from .commands import Answer, call, files_in, sets
from .games import HALF_WIDTHS, quick_scenario

Capture = pytest.CaptureFixture[str]
Check = Callable[[BaseException], str]
# (19)-(21) as printed, in an envelope that holds the run
GRADIENT = (
    *("learner.rule=gradient", "learner.error=bellman", "learner.safeguard=false"),
    *("learner.normalizer=paper", "learner.leash=0", "simulation.duration=0.6"),
    "simulation.monitor_period=0.001",
)


@cache
def pairs(n: int = 40) -> Pairs:
    """V = ζ'Pζ (1 + |x|^2 / 10), with its gradient: a value that no quadratic form is."""
    station = quick_scenario().station_keeping()
    zeta = station.envelope * np.random.default_rng(6).uniform(-1.0, 1.0, (n, 12))
    x, P = zeta / HALF_WIDTHS, station.problem.P
    quadratic, factor = np.einsum("pi,ij,pj->p", zeta, P, zeta), 1.0 + 0.1 * np.sum(x**2, axis=1)
    gradient = 2.0 * zeta @ P * factor[:, None] + 0.2 * quadratic[:, None] * x / HALF_WIDTHS
    return Pairs(zeta, quadratic * factor, gradient)


@cache
def ideal() -> Ideal:
    found = fit(quick_scenario().station_keeping(), pairs(), pairs())
    return Ideal(found.weights, pairs(), Bounds(found.epsilon.sup, found.epsilon_prime.sup, 40))


@cache
def record() -> xr.Dataset:
    return online_record(quick_scenario(*GRADIENT))


@cache
def found() -> Theory:
    return theory(quick_scenario(*GRADIENT), record(), ideal())


@cache
def rows() -> dict[str, Condition]:
    return {row.name: row for row in run_conditions(quick_scenario(*GRADIENT), record(), found())}


def one(words: str) -> Condition:
    (row,) = [row for name, row in rows().items() if words in name]
    return row


def test_v_l_and_z_one_step_after_another() -> None:
    run, station, W = record(), quick_scenario().station_keeping(), ideal().weights
    times = run["time"].values.tolist()
    for i, t in enumerate(run["learn_time"].values):
        zeta = run["zeta"].values[int(np.argmin(np.abs(np.array(times) - t)))]
        errors = [W - run[name].values[i] for name in ("critic", "actor_1", "actor_2")]
        squares = [float(error @ error) for error in errors]
        V = float(W @ station.functions.sigma(zeta)[0])
        assert found().value[i] == pytest.approx(V, rel=1e-9)
        assert found().lyapunov[i] == pytest.approx(V + 0.5 * sum(squares))
        assert found().size[i] == pytest.approx(np.sqrt(zeta @ zeta + sum(squares)))
        np.testing.assert_allclose(found().errors[i], np.sqrt(squares))
    late = run["learn_time"].values >= 0.9 * run["learn_time"].values[-1]
    assert found().ultimate == found().size[late].max()


def test_weights_that_are_ideal_leave_v() -> None:
    """Ŵ = W all along: V_L is V and |Z| is |ζ|."""
    same = record().copy(deep=True)
    for name in ("critic", "actor_1", "actor_2"):
        same[name].values[:] = ideal().weights
    alone = theory(quick_scenario(*GRADIENT), same, ideal())
    np.testing.assert_allclose(alone.lyapunov, alone.value, rtol=1e-12)
    assert alone.size[0] == pytest.approx(np.linalg.norm(same["zeta"].values[0]))
    falls = {c.name: c for c in run_conditions(quick_scenario(*GRADIENT), same, alone)}
    assert falls["V_L never rises"].holds is True


def test_what_was_watched() -> None:
    run = record()
    margin = one("c_lower > 0 along")
    assert margin.value == run["rank_margin"].values.min() == found().c_lower
    assert margin.holds is True
    ball = one("stays in the projection")
    assert ball.value == run["actor_norm"].values.max()
    sizes = np.linalg.norm(run["actor_1"].values, axis=1)
    bound = 3.0 * np.linalg.norm(quick_scenario().station_keeping().riccati_weights)
    assert run["actor_norm"].values[-1, 0] == pytest.approx(sizes[-1] / bound)
    assert found().bound == pytest.approx(bound)


def test_whether_the_run_stayed_in_chi() -> None:
    run, envelope = record(), quick_scenario().station_keeping().envelope
    share = np.abs(run["zeta"].values) / envelope
    stayed = one("stays in χ")
    assert stayed.value == pytest.approx(share.max())
    assert stayed.holds is bool(share.max() <= 1.0)
    name = str(run["state"].values[np.unravel_index(share.argmax(), share.shape)[1]])
    assert name in stayed.note
    small = run.copy(deep=True)
    small["zeta"].values[:] *= 0.5 / share.max()
    inside = {c.name: c for c in run_conditions(quick_scenario(*GRADIENT), small)}
    assert inside["the run stays in χ"].holds is True


def test_there_is_no_k_where_25_fails_and_one_at_admissible_gains() -> None:
    assert one("α_5 > 0").holds is False
    ball = one("ultimate |Z|")
    assert (ball.value, ball.bound, ball.holds) == (found().ultimate, None, None)
    slow, gains = one("the same at gains"), found().admissible
    assert slow.bound is not None
    assert slow.holds is True
    assert slow.bound > 1e6 * found().ultimate, "sufficient, and far from necessary"
    assert gains is not None
    rate = gains.critic * found().c_lower
    assert f"{1.0 / (rate * 3.156e7):.2g} years" in slow.note
    assert one("Remark 3's").holds is False


def test_a_real_disturbance_is_named() -> None:
    scenario = quick_scenario(*GRADIENT, "simulation.mode=disturbed")
    listed = run_conditions(scenario, record(), found())
    (falls,) = [c for c in listed if "V_L" in c.name]
    assert "another disturbance" in falls.note
    assert "another disturbance" not in one("V_L never").note


def test_lost_rank_admits_no_gains() -> None:
    lost = record().copy(deep=True)
    lost["rank_margin"].values[-1] = 0.0
    at = theory(quick_scenario(*GRADIENT), lost, ideal())
    assert at.admissible is None
    listed = {c.name: c for c in run_conditions(quick_scenario(*GRADIENT), lost, at)}
    assert listed["c_lower > 0 along the run"].holds is False
    assert "lost its rank" in listed["the same at gains that (24) and (25) admit"].note


def test_without_samples_18_has_no_rank_and_the_rest_is_told(tmp_path: Path) -> None:
    """Costate rows need none: the run learns, and nothing is known of the regressors."""
    scenario = quick_scenario(
        *("samples.number=0", "learner.error=costate", "learner.safeguard=true"),
        "simulation.duration=0.6",
    )
    run = online_record(scenario)
    at = theory(scenario, run, ideal())
    listed = {c.name: c for c in run_conditions(scenario, run, at)}
    assert listed["c_lower > 0 along the run"].holds is False
    assert "|ω / p| <= 1 along the run" not in listed
    assert "V_L never rises" in listed
    page = Page(tmp_path)
    draw_monitor(page, run, None)
    assert page.files["monitor"].is_file()


def test_a_record_without_learning_is_refused(one_sentence: Check) -> None:
    still = record().isel(look_time=slice(0, 0))
    with pytest.raises(InputError, match="no run that learned") as caught:
        require_run(still, "linear.nc")
    one_sentence(caught.value)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ideal weights and a run of the quick scenario."""
    folder = tmp_path_factory.mktemp("theory")
    scenario = quick_scenario(*GRADIENT)
    whole = fit(scenario.station_keeping(), pairs(), pairs())
    save(ideal_record(scenario, whole, pairs(), pairs()), folder / "ideal-weights.nc")
    save(record(), folder / "learned.nc")
    save(record().isel(look_time=slice(0, 0)), folder / "still.nc")
    bare = record().copy()
    bare.attrs = {}
    save(bare, folder / "bare.nc")
    return folder


def checked(capsys: Capture, *words: str) -> Answer:
    return call(capsys, "check", "--quiet", *words)


def test_the_command_checks_a_run_with_its_own_scenario(files: Path, capsys: Capture) -> None:
    plain = checked(capsys, "--json", "--run", str(files / "learned.nc")).json()["conditions"]
    words = ("--ideal-weights", str(files / "ideal-weights.nc"))
    whole = checked(capsys, "--json", "--run", str(files / "learned.nc"), *words).json()["conditions"]
    names = [row["name"] for row in whole]
    assert [row["name"] for row in plain] == names[: len(plain)]
    assert {"V_L never rises", "α_5 > 0", "the run stays in χ"} <= set(names)
    assert len(set(names)) == len(names)
    by_name = {row["name"]: row for row in whole}
    lowest = float(record()["rank_margin"].min())
    assert by_name["c_lower > L_f sup|ε'| / (2 ε) + (η_a1 + η_a2) / (2 η_c)"]["value"] == lowest
    for row in whole:
        assert set(row) == {"name", "paper", "value", "bound", "holds", "note"}
        assert (row["value"] is None) <= (row["holds"] is None)
    table = checked(capsys, "--run", str(files / "learned.nc"), *words)
    assert table.code == 0
    assert "Remark 3" in table.out


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--run", "learned.nc", *sets("game.gamma=3")), "leave out the scenario and --set"),
        (("rexrov", "--run", "learned.nc"), "leave out the scenario and --set"),
        (("--run", "still.nc"), "no run that learned"),
        (("--run", "bare.nc"), "does not say what was run"),
        (("--run", "missing.nc"), "there is no record"),
    ],
)
def test_bad_runs_are_one_sentence(
    words: tuple[str, ...],
    expected: str,
    files: Path,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(files)
    answer = checked(capsys, *words)
    assert answer.code == 2
    assert expected in answer.sentence()
    assert {"still.nc", "learned.nc"} <= set(files_in(files))


def test_ideal_weights_of_an_analysis() -> None:
    """`compare` fits them itself, and takes ε and ε' where it fitted."""
    station = quick_scenario().station_keeping()
    states, values, gradients = pairs().states, pairs().values, pairs().gradients
    analysis = xr.Dataset(
        {
            "ideal_weights": ("basis", ideal().weights),
            "optimum_zeta": (("optimum", "state"), states),
            "optimum_value": ("optimum", values),
            "optimum_costate": (("optimum", "state"), gradients),
        }
    )
    kept = ideal_of(station, analysis)
    assert kept is not None
    worst = max(
        abs(V - ideal().weights @ station.functions.sigma(zeta)[0])
        for zeta, V in zip(states, values, strict=True)
    )
    assert kept.bounds.epsilon == pytest.approx(worst)
    assert (kept.bounds.n_states, len(kept.pairs.values)) == (40, 40)
    analysis["ideal_weights"].values[0] = np.nan
    assert ideal_of(station, analysis) is None
