"""Unstable plants, input that is refused, and solves that do not converge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
import pytest
from casadi import SX
from stationkeep.offline import DirectSolver, OfflineSettings, OfflineSolver, Plant, solve
from stationkeep.offline.path import reintegrate
from stationkeep.symbolic import Game, InputError, Problem, RunError

from .games import FAR_STATE, Array, linear_quadratic, two_state

Check = Callable[[BaseException], str]


def unstable(rate: float) -> Problem:
    """A state that leaves at `rate` 1/s and a cubic that helps it, beside the two-state game."""
    zeta = SX.sym("zeta", 2)
    drift = casadi.vertcat(rate * zeta[0] + 0.1 * zeta[0] ** 3, -zeta[1] + zeta[0])
    game = Game(np.eye(2), np.eye(1), np.eye(1), 2.0)
    return Problem("unstable", zeta, drift, SX(np.array([[1.0], [0.0]])), game, np.ones(2))


@pytest.mark.parametrize("rate", [1.0, 5.0])
def test_unstable_plant_is_reintegrated_interval_by_interval(rate: float) -> None:
    """Chained over 20 s, rounding would grow by e^{20 rate}."""
    problem = unstable(rate)
    assert np.linalg.eigvals(problem.linearization[0]).real.max() == pytest.approx(rate)
    solver = DirectSolver(problem, horizon=20.0, n_intervals=40, degree=5, grading=4.0)
    zeta0 = np.array([0.8, -0.5])
    answer = solver.solve(zeta0)
    assert answer.defect < 1e-5
    assert answer.reintegrated_value == pytest.approx(answer.value, rel=1e-6)
    path = answer.trajectory
    shifted = zeta0 + 1e-9
    state = shifted
    for i in range(len(path.mesh) - 1):
        polynomial = path.input_polynomial(i)
        try:
            with np.errstate(all="ignore"):
                states, _ = solver.plant.simulate(
                    state, lambda t, z, p=polynomial: np.asarray(p(t)), path.mesh[i : i + 2]
                )
        except (RunError, RuntimeWarning):
            break
        state = states[-1]
        if np.abs(state).max() > 1.0:
            break
    assert np.abs(state).max() > 0.5


def test_two_state_game_is_unstable_and_certified() -> None:
    problem, _, _ = two_state()
    assert np.linalg.eigvals(problem.linearization[0]).real.max() > 2.0
    answer = solve(problem, np.array([1.0, -0.7]), OfflineSettings(horizon=25.0, intervals=30))
    assert answer.faults == []
    assert answer.certificate.defect < 1e-6


def test_stable_plant_is_reintegrated_in_one_go() -> None:
    """From ζ_0 only: a trajectory that is broken in the middle is noticed by all that follows."""
    problem, _, _ = linear_quadratic()
    solver = DirectSolver(problem, horizon=10.0, n_intervals=10, degree=5, grading=1.0)
    path = solver.solve(FAR_STATE, verify=False).trajectory
    assert reintegrate(solver.plant, FAR_STATE, path)[0] < 1e-4
    jumped = path.states.copy()
    jumped[26:] += 0.1 * problem.scale
    broken = type(path)(path.mesh, path.times, jumped, path.v, path.degree)
    assert reintegrate(solver.plant, FAR_STATE, broken)[0] == pytest.approx(0.1, abs=1e-3)


BAD: dict[str, object] = {
    "NaN": np.full(12, np.nan),
    "infinity": np.where(np.arange(12) == 3, np.inf, 0.0),
    "eleven numbers": np.zeros(11),
    "two rows": np.zeros((2, 12)),
    "nothing": [],
    "words": ["a"] * 12,
    "ragged": [[0.0] * 11, 0.0],
    "pitched up": np.pi / 2 * (np.arange(12) == 4),
    "pitched over": -2.0 * (np.arange(12) == 4),
}


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("how", ["solve", "OfflineSolver", "DirectSolver", "aligned"])
def test_bad_states_are_refused(
    name: str, how: str, reference_problem: Problem, one_sentence: Check
) -> None:
    problem = reference_problem
    small = OfflineSettings(horizon=5.0, intervals=4)
    direct = DirectSolver(problem, horizon=5.0, n_intervals=4)
    calls: dict[str, Callable[[], object]] = {
        "solve": lambda: solve(problem, BAD[name], small),  # type: ignore[arg-type]
        "OfflineSolver": lambda: OfflineSolver(problem, small).solve(BAD[name]),  # type: ignore[arg-type]
        "DirectSolver": lambda: direct.solve(BAD[name]),  # type: ignore[arg-type]
        "aligned": lambda: direct.solve_aligned(BAD[name]),  # type: ignore[arg-type]
    }
    with pytest.raises(InputError) as caught:
        calls[how]()
    one_sentence(caught.value)


def test_a_list_is_a_state(one_sentence: Check) -> None:
    problem, _, _ = two_state()
    assert solve(problem, [0.5, 0.5], OfflineSettings(horizon=5.0, intervals=10)).value > 0.0  # type: ignore[arg-type]
    with pytest.raises(InputError, match="2 numbers") as caught:
        solve(problem, np.zeros(12))
    one_sentence(caught.value)


def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every IPOPT that is built from now on stop after one iteration."""
    original = casadi.nlpsol

    def one_iteration(name: str, kind: str, program: Any, options: dict[str, Any]) -> casadi.Function:
        options["ipopt"]["max_iter"] = 1
        return original(name, kind, program, options)

    monkeypatch.setattr(casadi, "nlpsol", one_iteration)


@pytest.mark.parametrize("how", ["solve", "aligned", "certified"])
def test_no_convergence_is_an_error_with_its_status(
    how: str, monkeypatch: pytest.MonkeyPatch, one_sentence: Check
) -> None:
    problem, _, _ = two_state()
    direct = DirectSolver(problem, horizon=8.0, n_intervals=20)
    impatient(monkeypatch)
    calls: dict[str, Callable[[Array], object]] = {
        "solve": direct.solve,
        "aligned": direct.solve_aligned,
        "certified": lambda zeta: solve(problem, zeta, OfflineSettings(horizon=8.0, intervals=20)),
    }
    with pytest.raises(RunError, match="Maximum_Iterations_Exceeded") as caught:
        calls[how](np.array([1.5, -1.9]))
    message = one_sentence(caught.value)
    assert "after 1 iterations" in message
    assert "1.5" in message


def test_absurd_states_end_in_a_run_error(one_sentence: Check) -> None:
    """Finite, so not bad input, but no number comes of it."""
    problem, _, _ = two_state()
    direct = DirectSolver(problem, horizon=8.0, n_intervals=10)
    with np.errstate(all="ignore"), pytest.raises(RunError, match="Invalid_Number") as caught:
        direct.solve(np.array([1e200, 1e200]))
    one_sentence(caught.value)


def test_simulation_that_escapes_is_a_run_error(one_sentence: Check) -> None:
    plant = Plant(unstable(3.0))

    def idle(t: float, zeta: Array) -> Array:
        return np.zeros(1)

    with pytest.raises(RunError, match=r"integration (failed|became too stiff)") as caught:
        plant.simulate(np.array([1.0, 0.0]), idle, np.array([0.0, 10.0]))
    one_sentence(caught.value)
