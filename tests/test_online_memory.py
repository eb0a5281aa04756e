"""What a run remembers of the envelope, and frozen weights under the safeguard."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.offline import DirectSolver
from stationkeep.online import (
    Controller,
    Learner,
    LearnerSettings,
    Policy,
    draw_samples,
    load_weights,
    run,
    save,
    to_dataset,
)
from stationkeep.online.learning.memory import EnvelopeMemory

from .games import TWO_STATE_WEIGHTS, Array, linear_on, quick_scenario, two_state

REFERENCE = np.array([0.8, 0.2, 1.4])
SETTINGS = LearnerSettings(steps=200)


def remembering(entry: float, n_steps: int = 40) -> Learner:
    problem, basis, functions = two_state()
    taught = Learner(
        problem,
        basis,
        SETTINGS,
        np.zeros((0, 2)),
        REFERENCE,
        functions=functions,
        envelope=problem.scale,
    )
    for _ in range(n_steps):
        taught.step(np.array([entry, 0.0]), 0.25)
    return taught


@pytest.mark.slow
def test_remembered_weights_are_optimal_in_the_whole_envelope() -> None:
    """V* = ζ_1^2 / 2 + ζ_2^2 from states that the vehicle never came near."""
    taught = remembering(1e-3, n_steps=100)
    assert isinstance(taught.memory, EnvelopeMemory)
    weights = taught.memory.weights
    np.testing.assert_allclose(weights[1:], TWO_STATE_WEIGHTS[1:], atol=5e-3)
    problem = two_state()[0]
    ratios = []
    for zeta in draw_samples(problem.scale, 20, 5):
        value = zeta[0] ** 2 / 2 + zeta[1] ** 2
        cost = taught.predicted_cost(zeta, weights, weights)
        assert cost == pytest.approx(value, rel=1e-4)
        ratios.append(cost / taught.predicted_cost(zeta, REFERENCE, REFERENCE))
    assert np.mean(ratios) < 0.99
    assert taught.memory.relative_cost == pytest.approx(np.mean(ratios), abs=0.03)


def test_remembered_weights_do_not_move_the_policy() -> None:
    problem, basis, functions = two_state()
    plain = Learner(problem, basis, SETTINGS, np.zeros((0, 2)), REFERENCE, functions=functions)
    for _ in range(40):
        plain.step(np.array([0.5, 0.0]), 0.25)
    np.testing.assert_array_equal(plain.actor_1, remembering(0.5).actor_1)


COSTATE = ("learner.error=costate", "learner.safeguard=true", "learner.steps=100")


@pytest.mark.slow
def test_a_record_keeps_what_was_remembered(tmp_path: Path) -> None:
    scenario = quick_scenario(*COSTATE, "samples.remember=true", "simulation.duration=4")
    history = run(scenario)
    assert history.remembered is not None
    path = save(to_dataset(history, {}), tmp_path / "run.nc")
    np.testing.assert_array_equal(load_weights(path), history.remembered)
    assert not np.array_equal(history.remembered, history.critic[-1])
    dataset = to_dataset(history, {})
    assert dataset.attrs["n_fallback"] == dataset["fallback"].values.sum()
    assert np.all(np.isfinite(dataset["predicted_cost"].values[:-1]))


@pytest.mark.parametrize(("factor", "fallback"), [(1.0, False), (0.05, True), (-1.0, True)])
def test_frozen_weights_worse_than_linear_are_not_used(
    tmp_path: Path, factor: float, fallback: bool
) -> None:
    scenario = quick_scenario(*COSTATE, "simulation.duration=0.1")
    history = run(scenario)
    history.critic[-1] = factor * history.critic[-1]
    path = save(to_dataset(history, {}), tmp_path / "run.nc")
    frozen = quick_scenario(*COSTATE, f'learner.weights="{path}"')
    controller = Controller(frozen, learn=False)
    controller.step(frozen.initial_state[:6], frozen.initial_state[6:], 0.02)
    assert controller.last_step is not None
    assert controller.last_step.fallback is fallback
    expected = controller.setup.riccati_weights if fallback else history.critic[-1]
    np.testing.assert_array_equal(controller.learner.actor_1, expected)


@pytest.mark.slow
def test_frozen_weights_are_far_better_than_linear_in_the_whole_envelope(tmp_path: Path) -> None:
    """One run from another state, then 8 seeded states at s = 0.6 without learning.

    Regret relative to linear: the median at most a third of it, the largest at most half.
    """
    scenario = Scenario.load("bluerov2-heavy", ["envelope.scale=0.6", "simulation.mode=game"])
    station = scenario.station_keeping()
    P, envelope = station.problem.P, station.envelope
    solver = DirectSolver(station.problem, horizon=60.0, n_intervals=16, degree=6, grading=6)

    def regret(one: Scenario, zeta: Array, policy: Policy) -> float:
        history = run(one.with_settings(simulation={"initial_state": zeta}), policy)
        assert history.stopped is None
        end = history.zeta[-1]
        cost = history.cost[-1] - history.attenuated[-1] + end @ P @ end
        return float(cost / solver.solve(zeta, verify=False).value - 1.0)

    (start,) = draw_samples(envelope, 1, 21)
    started = time.process_time()
    taught = run(
        scenario.with_settings(simulation={"initial_state": start}, samples={"remember": True})
    )
    assert time.process_time() - started < 60.0  # faster than real time
    path = save(to_dataset(taught, {}), tmp_path / "run.nc")
    kept = scenario.with_settings(learner={"weights": str(path)})
    states = draw_samples(envelope, 8, 22)
    frozen = np.array([regret(kept, zeta, Controller(kept, learn=False)) for zeta in states])
    linear = np.array([regret(scenario, zeta, linear_on(station)) for zeta in states])
    assert np.median(frozen) < np.median(linear) / 3.0
    assert frozen.max() < linear.max() / 2.0
    assert np.all(frozen < linear)
