"""Controls that are held: closed forms of one mode, vehicles with fast ones, what was learned."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from casadi import DM, SX
from stationkeep import Game, Problem, Scenario
from stationkeep.comparison.merit import learning_fault
from stationkeep.comparison.theory.numerical_conditions import numerical_conditions
from stationkeep.online.learning import LearnerSettings, learning_period, paid_share
from stationkeep.online.loop import MeanState, require_held
from stationkeep.symbolic import InputError
from stationkeep.symbolic.game import fastest_mode, held_loop, longest_period, mean_matrix

VEHICLES = Path(__file__).parent / "cases" / "vehicles"


def one_mode(damping: float, weight: float) -> Problem:
    """Return x_dot = -a x + u with cost q x^2 + u^2 and nobody who disturbs."""
    x = SX.sym("x", 1)
    game = Game(np.array([[weight]]), np.eye(1), np.eye(1), np.inf)
    return Problem(
        name="one mode",
        zeta=x,
        drift=-damping * x,
        control_matrix=SX(DM(1.0)),
        game=game,
        scale=np.ones(1),
        state_names=("x",),
    )


def gain(damping: float, weight: float) -> float:
    """Return k of the scalar Riccati equation p^2 + 2 a p = q, k = p."""
    return float(np.sqrt(damping**2 + weight) - damping)


@pytest.mark.parametrize(("a", "q", "h"), [(0.5, 4.0, 0.1), (2.0, 9.0, 0.5), (0.1, 100.0, 0.05)])
def test_radius_of_one_mode_is_that_of_the_held_recursion(a: float, q: float, h: float) -> None:
    """x_{k+1} = (e^{-ah} - (1 - e^{-ah}) k / a) x_k, and the continuous loop decays with a + k."""
    k, decay = gain(a, q), np.exp(-a * h)
    loop = held_loop(one_mode(a, q), h)
    assert loop.radius == pytest.approx(abs(decay - (1.0 - decay) * k / a), rel=1e-9)
    assert loop.bound == pytest.approx(np.exp(-0.5 * (a + k) * h), rel=1e-9)
    margin = min((1.0 + decay) * a / ((1.0 - decay) * k), 8.0)
    assert loop.gain_margin == pytest.approx(margin, rel=1e-6)
    assert fastest_mode(one_mode(a, q)) == (pytest.approx(a + k), "x")


def test_the_longest_period_holds_and_a_longer_one_does_not() -> None:
    problem = one_mode(0.1, 100.0)
    longest = longest_period(problem, 10.0)
    assert held_loop(problem, longest).holds
    assert not held_loop(problem, 1.1 * longest).holds
    require_held(problem, longest)
    with pytest.raises(InputError, match=r"a mode at 10 1/s in x; it needs at most 0\.\d+ s"):
        require_held(problem, 1.0)


def test_the_mean_state_makes_an_integrator_end_where_the_continuous_loop_does() -> None:
    """x_dot = u with u = -k φ_1(-kh) x held: x(h) = (1 - k h φ_1(-kh)) x = e^{-kh} x."""
    problem, h = one_mode(0.0, 25.0), 0.3
    mean = MeanState(problem)(np.array([2.0]), h)
    assert mean[0] == pytest.approx(2.0 * mean_matrix(problem, h)[0, 0])
    assert 2.0 - 5.0 * h * mean[0] == pytest.approx(2.0 * np.exp(-5.0 * h))
    slow = np.array([1.0])
    assert MeanState(problem)(slow, 0.04) is slow


def test_learning_is_more_frequent_where_the_cost_is_paid_sooner() -> None:
    """The share is 1 - e^{-2 (a + k) T} for one mode."""
    slow, quick = one_mode(0.1, 0.01), one_mode(1.0, 9.0)
    assert paid_share(quick, 0.2) == pytest.approx(1.0 - np.exp(-0.4 * np.sqrt(10.0)))
    assert learning_period(slow, LearnerSettings()) == 0.25
    period = learning_period(quick, LearnerSettings())
    assert paid_share(quick, period) <= 0.03 < paid_share(quick, 2.0 * period)
    assert learning_period(quick, LearnerSettings(period=0.1)) == 0.1


def test_a_vehicle_that_the_period_cannot_hold_is_refused_in_one_sentence(tmp_path: Path) -> None:
    scenario = VEHICLES / "micro-auv-scenario.toml"
    done = subprocess.run(
        [sys.executable, "-m", "stationkeep.cli.main", "online", str(scenario), "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert "can't hold this game" in done.stderr
    assert "238 1/s in phi_dot; it needs at most 0.0082 s" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lauv", "girona500", "saga", "videoray"])
def test_predictions_of_vehicles_with_fast_modes_are_accurate(name: str) -> None:
    listed = {
        c.name: c for c in numerical_conditions(Scenario.load(VEHICLES / f"{name}-scenario.toml"))
    }
    assert listed["predicted costs are accurate"].holds
    assert listed["the held loop is stable"].holds


def record(predicted: list[float], accepted: list[float], error: list[float]) -> xr.Dataset:
    data = {"predicted_cost": predicted, "accepted": accepted, "sample_error": error}
    return xr.Dataset({name: ("learn_time", values) for name, values in data.items()})


def test_nothing_learned_is_said_and_learning_is_not() -> None:
    infinite, nan = float("inf"), float("nan")
    lost = learning_fault(record([infinite] * 3, [0.0] * 3, [nan] * 3))
    assert lost is not None
    assert "each of the 3 predicted costs was infinite" in lost
    refused = learning_fault(record([5.0] * 3, [0.0] * 3, [0.1] * 3))
    assert refused is not None
    assert "1 % of the cost" in refused
    assert learning_fault(record([5.0] * 3, [0.0] * 3, [0.01] * 3)) is None  # nothing was left
    assert learning_fault(record([5.0, 4.0], [0.0, 0.5], [0.1, 0.1])) is None
    assert learning_fault(record([nan] * 2, [1.0] * 2, [0.1] * 2)) is None  # nothing is predicted
    assert learning_fault(xr.Dataset()) is None
