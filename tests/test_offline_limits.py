"""Limits of an offline solve: it ends with its reason and what it has, whichever method is at work."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import casadi
import numpy as np
import pytest
from casadi import SX
from stationkeep.offline import (
    BestResponse,
    ControlPolicy,
    DirectSolver,
    EndedByLimitError,
    GammaCurveSolver,
    Limits,
    OfflineSettings,
    OfflineSolver,
    QuickValue,
    ScheduledWorstCase,
    WeightSchedule,
    WorstCaseSolver,
    linear_policy,
)
from stationkeep.offline.direct import against_known
from stationkeep.offline.limits import LimitError, Work, check, count, limited
from stationkeep.offline.responses import ClairvoyantSolver
from stationkeep.online import load
from stationkeep.symbolic import Problem, RunError

from .commands import LOOSE, ROUGH, call, sets
from .games import FAR_STATE, Array, linear_quadratic, two_state

Capture = pytest.CaptureFixture[str]
Check = Callable[[BaseException], str]
NAMED = r"ended after \d+ iterations and [\d.]+ s by its limit offline\.max_{}"
START = np.array([1.0, -0.7])


def counting(n: int, limits: Limits) -> Work:
    """Count `n` iterations within limits."""
    with limited(limits) as work:
        for _ in range(n):
            count()
    return work


def test_iterations_are_counted_and_end_the_work(one_sentence: Check) -> None:
    with pytest.raises(EndedByLimitError, match=r"after 3 iterations .* limit here.max_iter") as caught:
        counting(10, Limits(max_iterations=3, name="here"))
    assert isinstance(caught.value, RunError), "what a caller of a solver expects"
    one_sentence(caught.value)
    assert counting(3, Limits(max_iterations=3)).iterations == 3
    count()  # outside there is no limit
    check()


def test_time_ends_the_work_without_an_iteration() -> None:
    def work() -> None:
        with limited(Limits(max_seconds=0.01)):
            time.sleep(0.02)
            check()

    with pytest.raises(EndedByLimitError, match=r"after 0 iterations .* limit offline.max_seconds"):
        work()


def test_the_limit_of_the_whole_goes_through_that_of_a_part() -> None:
    """A part whose own limit is not reached must not look like a part that failed."""
    after: list[str] = []

    def whole(limits: Limits, part: Limits) -> None:
        with limited(limits):
            try:
                counting(5, part)
            except RunError:
                after.append("the part failed")

    hundred = Limits(max_iterations=100, name="part")
    with pytest.raises(EndedByLimitError, match=r"offline\.max_iterations = 2"):
        whole(Limits(max_iterations=2), hundred)
    assert after == []
    whole(Limits(), Limits(max_iterations=1, name="part"))
    assert after == ["the part failed"]
    with limited(Limits(max_iterations=7)) as both, pytest.raises(LimitError, match="= 7"):
        [counting(5, hundred) for _ in range(2)]
    assert both.iterations == 7


def test_a_reached_limit_is_no_failure_of_a_start() -> None:
    assert not issubclass(LimitError, RunError), "searches go on after a RunError"


@pytest.mark.parametrize("method", ["newton", "ipopt"])
def test_a_solve_without_an_optimum_says_why_and_what_it_had(
    method: str, reference_problem: Problem, one_sentence: Check
) -> None:
    settings = OfflineSettings(horizon=40.0, intervals=12, method=method, max_iterations=1)
    with pytest.raises(EndedByLimitError, match=NAMED.format("iterations")) as caught:
        OfflineSolver(reference_problem, settings).solve(FAR_STATE)
    one_sentence(caught.value)
    reached = caught.value.reached
    assert reached is not None
    np.testing.assert_allclose(reached.states[0], FAR_STATE, atol=1e-6)
    assert reached.times[-1] == pytest.approx(40.0)
    assert reached.states.shape == (len(reached.times), 12)
    assert reached.v.shape == (len(reached.times) - 1, 6)


def test_what_newton_had_is_a_trajectory_and_no_cheaper_than_the_value() -> None:
    """Of a linear game every collocated trajectory costs at least ζ'P ζ, to the mesh's error."""
    problem, _, _ = linear_quadratic()
    solver = OfflineSolver(problem, OfflineSettings(horizon=60.0, max_iterations=1))
    with pytest.raises(EndedByLimitError) as caught:
        solver.solve(FAR_STATE)
    if caught.value.reached is not None:
        assert caught.value.reached.cost >= FAR_STATE @ problem.P @ FAR_STATE * (1.0 - 1e-6)


@pytest.mark.parametrize("method", ["newton", "ipopt"])
def test_an_optimum_without_its_certificate_is_kept_and_not_certified(
    method: str, reference_problem: Problem
) -> None:
    settings = OfflineSettings(horizon=60.0, intervals=20, method=method, max_iterations=40)
    whole = DirectSolver(reference_problem, settings.mesh(reference_problem), method=method)  # type: ignore[arg-type]
    found = OfflineSolver(reference_problem, settings).solve(FAR_STATE)
    assert found.value == pytest.approx(whole.solve(FAR_STATE, verify=False).value, rel=1e-9)
    assert "max_iterations = 40" in found.ended
    assert found.faults[0] == found.ended
    assert np.isnan(found.certificate.value_error)
    assert "value_error is not known" in found.faults
    assert found.rounds == 0


def test_a_solve_within_its_limits_is_not_touched() -> None:
    problem, _, _ = two_state()
    settings = OfflineSettings(horizon=25.0, intervals=30)
    answer = OfflineSolver(problem, settings).solve(START)
    assert (answer.ended, answer.faults) == ("", [])
    more = OfflineSettings(horizon=25.0, intervals=30, max_iterations=10**6, max_seconds=1e6)
    assert OfflineSolver(problem, more).solve(START).value == answer.value


def test_time_ends_ipopt_between_two_iterations() -> None:
    problem, _, _ = two_state()
    direct = DirectSolver(problem, horizon=20.0, n_intervals=30, degree=5)
    direct.solve(START, verify=False)
    with pytest.raises(EndedByLimitError, match="max_seconds"), limited(Limits(max_seconds=0.0)):
        direct.solve(START, verify=False)
    answer = direct.solve(START, verify=False)
    assert answer.value == pytest.approx(0.5 * START[0] ** 2 + START[1] ** 2, rel=1e-5)


def test_a_quick_value_has_a_limit() -> None:
    problem, _, _ = two_state()
    with pytest.raises(RunError, match=r"limit here\.max_iterations = 1"):
        QuickValue(problem, limits=Limits(max_iterations=1, name="here"))(START)


def test_best_responses_and_worst_cases_end() -> None:
    problem, basis, _ = two_state()
    few = Limits(max_iterations=1)
    path = DirectSolver(problem, horizon=20.0, n_intervals=30).solve(START, verify=False)
    with pytest.raises(EndedByLimitError):
        BestResponse(problem, limits=few).solve(START, path.value, path.trajectory)
    policy = ControlPolicy(problem, linear_policy(problem))
    worst = WorstCaseSolver(policy, limits=few, horizon=20.0).solve(START)
    schedule = WeightSchedule.constant(np.array([0.5, 0.0, 1.0]))
    other = ScheduledWorstCase(problem, basis, limits=few, horizon=20.0).solve(START, schedule)
    for case in (worst, other):
        assert case.ended
        assert "max_iterations = 1" in str(case.unbounded)
        assert "runs off" not in str(case.unbounded), "that the disturbance does is not known"


def test_a_curve_ends_with_the_levels_that_it_has() -> None:
    problem, _, _ = linear_quadratic()
    levels = (2.0, 3.0, 5.0)
    whole = GammaCurveSolver(problem, levels, horizon=40.0).solve(FAR_STATE)
    assert whole.faults == []
    part = GammaCurveSolver(problem, levels, horizon=40.0, limits=Limits(max_iterations=4))
    curve = part.solve(FAR_STATE)
    assert curve.undisturbed.value == whole.undisturbed.value
    assert "max_iterations = 4" in curve.points[0].fault
    assert len(curve.faults) >= 1


def pushed(limits: Limits) -> ClairvoyantSolver:
    """A point that drag slows down, under a known push."""
    zeta, w, t = SX.sym("zeta", 2), SX.sym("w"), SX.sym("t")
    drag = zeta[1] * casadi.fabs(zeta[1])
    rate = casadi.vertcat(zeta[1], w - drag + casadi.sin(2.0 * t))
    stage = against_known(zeta, w, t, rate, np.eye(2), np.eye(1))
    return ClairvoyantSolver(stage, np.eye(1), 6.0, limits=limits)


def test_a_clairvoyant_search_ends_with_the_best_that_it_has() -> None:
    def starts() -> Iterator[Callable[[float, Array], Array]]:
        for gain in (0.5, 1.0, 2.0, 4.0):
            yield lambda t, zeta, k=gain: np.array([-k * zeta.sum()])  # type: ignore[misc]

    whole = pushed(Limits()).solve(START, starts())
    assert whole.ended == ""
    spent = int(whole.iterations)
    part = pushed(Limits(max_iterations=spent - 3)).solve(START, starts())
    assert "max_iterations" in part.ended
    assert part.value == pytest.approx(whole.value, rel=1e-3)
    with pytest.raises(EndedByLimitError):
        pushed(Limits(max_iterations=1)).solve(START, starts())


@pytest.fixture
def heeded() -> Iterator[None]:
    """Ctrl-C is heeded, also where the tests were started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeded")
def test_ctrl_c_inside_ipopt_is_ctrl_c(reference_problem: Problem) -> None:
    """CasADi makes a failure of IPOPT of it, after which a search would try its next start."""
    direct = DirectSolver(reference_problem, n_intervals=60, degree=5, method="ipopt")
    program = direct._program(60, 5)
    times = program.times(direct.mesh)
    rng = np.random.default_rng(0)
    far = rng.standard_normal((len(times), 12)), rng.standard_normal((len(times), 6))
    program.solver  # noqa: B018 - built beforehand: that is no part of IPOPT
    pressed: list[float] = []

    def press() -> None:
        time.sleep(0.3)
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=press)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        program.solve(FAR_STATE, direct.mesh, *far)
    late = time.monotonic() - pressed[0]
    thread.join()
    assert late < 1.0
    assert signal.getsignal(signal.SIGINT) is before


def test_the_command_says_which_limit_and_keeps_what_it_had(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("offline", "--json", "--quiet", "--workers", "1", *sets(*ROUGH, *LOOSE))
    answer = call(capsys, *words, "--out", "a", "--set", "offline.max_iterations=1")
    assert answer.code == 1
    (state,) = answer.json()["states"]
    assert state["value"] is None
    (fault,) = state["faults"]
    assert "limit offline.max_iterations = 1" in fault
    record = load(tmp_path / "a" / "optimal-1.nc")
    assert record.attrs["failed"] == fault
    assert record["reached_zeta"].shape == (record.sizes["reached_time"], 12)
    assert record.attrs["reached_cost"] > 0.0
    answer = call(capsys, *words, "--out", "b", "--set", "offline.max_iterations=12")
    assert answer.code == 1
    (state,) = answer.json()["states"]
    assert state["value"] > 0.0
    assert state["certificate"]["value_error"] is None
    assert "limit offline.max_iterations = 12" in state["faults"][0]
    assert load(tmp_path / "b" / "optimal-1.nc").attrs["value"] == state["value"]
    call(capsys, *words, "--out", "c", "--set", "offline.max_seconds=0")
    assert call(capsys, *words, "--out", "c", "--set", "offline.max_seconds=0").code == 2
