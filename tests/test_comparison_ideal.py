"""Ideal weights of a scenario: states, pairs, the fit on what was held out, and what reads its file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Condition, Scenario, check
from stationkeep.comparison.optima import (
    HELD_OUT,
    TRAINING,
    Bounds,
    Optima,
    certified_pairs,
    envelope_states,
    fit,
    ideal_record,
    load_ideal,
)
from stationkeep.comparison.theory import scenario_conditions
from stationkeep.comparison.theory.conditions import drift_bound
from stationkeep.offline import Pairs
from stationkeep.online import Learner, load, load_weights, save
from stationkeep.symbolic import InputError, RunError

from .commands import LOOSE, QUICK, call, files_in, sets
from .games import HALF_WIDTHS, Array, quick_scenario

Capture = pytest.CaptureFixture[str]
Check = Callable[[BaseException], str]
TINY = (
    *("offline.horizon=12", "offline.intervals=6", "offline.degree=4", "offline.aligned=false"),
    *("offline.rounds=1", "offline.starts=0"),
)
SETTINGS = sets(*QUICK, *TINY, *LOOSE)


@cache
def made_up(n: int, seed: int) -> Pairs:
    """V = ζ'Pζ (1 + |x|^2 / 10) of the quick scenario, with its gradient: no quadratic form."""
    station = quick_scenario().station_keeping()
    zeta = envelope_states(station.envelope, n, seed, TRAINING)
    x, P = zeta / HALF_WIDTHS, station.problem.P
    quadratic, factor = np.einsum("pi,ij,pj->p", zeta, P, zeta), 1.0 + 0.1 * np.sum(x**2, axis=1)
    gradient = 2.0 * zeta @ P * factor[:, None] + 0.2 * quadratic[:, None] * x / HALF_WIDTHS
    return Pairs(zeta, quadratic * factor, gradient)


def test_states_of_the_envelope() -> None:
    envelope = 0.35 * HALF_WIDTHS
    zeta = envelope_states(envelope, 4000, 3, TRAINING)
    largest = np.abs(zeta / envelope).max(axis=1)
    assert largest.max() <= 1.0
    assert largest.min() < 0.15, "some are near the station"
    # the largest of 12 uniform numbers is on average 12/13, and U(0.1, 1) is 0.55
    assert largest.mean() == pytest.approx(0.55 * 12 / 13, abs=0.02)
    np.testing.assert_allclose(np.abs((zeta / envelope).mean(axis=0)), 0.0, atol=0.03)
    np.testing.assert_array_equal(envelope_states(envelope, 40, 3, TRAINING), zeta[:40])
    for other in (
        envelope_states(envelope, 40, 3, HELD_OUT),
        envelope_states(envelope, 40, 4, TRAINING),
    ):
        assert np.abs(other[:, None] - zeta[None, :200]).max(axis=2).min() > 1e-3


def test_errors_are_those_of_what_was_held_out() -> None:
    """The weights don't change with it, and every size is what a loop over it finds."""
    station = quick_scenario().station_keeping()
    training, others = made_up(60, 1), made_up(20, 2)
    found = fit(station, training, others)
    louder = replace(others, values=2.0 * others.values)
    again = fit(station, training, louder)
    np.testing.assert_array_equal(again.weights, found.weights)
    assert again.norm == found.norm
    assert again.epsilon.rms > 10.0 * found.epsilon.rms
    assert again.epsilon_prime == found.epsilon_prime
    game, learner = station.game, station.functions
    value, gradient, policy = [], [], []
    for zeta, V, V_zeta in zip(others.states, others.values, others.gradients, strict=True):
        value.append(V - found.weights @ learner.sigma(zeta)[0])
        u_control, u_disturbance = learner.policies(zeta, found.weights, found.weights)
        true_control, true_disturbance = game.policies(station.model.input_matrix(zeta), V_zeta)
        right = true_control + true_disturbance
        wrong = u_control + u_disturbance - right
        policy.append([np.sqrt(wrong @ game.R_eff @ wrong), np.sqrt(right @ game.R_eff @ right)])
        gradient.append(V_zeta - learner.sigma_prime(zeta)[0].T @ found.weights)
    assert found.epsilon.sup == pytest.approx(np.abs(value).max())
    assert found.epsilon.rms_relative == pytest.approx(
        np.sqrt(np.mean((np.array(value) / others.values) ** 2))
    )
    assert found.epsilon_prime.sup == pytest.approx(np.linalg.norm(gradient, axis=1).max())
    wrong, right = np.array(policy).T
    assert found.policy.sup == pytest.approx(wrong.max(), rel=1e-6)
    assert found.policy.rms == pytest.approx(np.sqrt(np.mean(wrong**2)), rel=1e-6)
    assert found.policy.sup_relative == pytest.approx((wrong / right).max(), rel=1e-6)


def test_the_linear_value_is_fitted_exactly() -> None:
    station = quick_scenario().station_keeping()
    zeta = envelope_states(station.envelope, 30, 1, TRAINING)
    P = station.problem.P
    pairs = Pairs(zeta, np.einsum("pi,ij,pj->p", zeta, P, zeta), 2.0 * zeta @ P)
    found = fit(station, pairs, pairs)
    expected = station.riccati_weights
    np.testing.assert_allclose(found.weights, expected, atol=1e-9 * np.abs(expected).max())
    assert found.policy.sup_relative < 1e-6


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of ideal weights of the quick scenario, from made-up values."""
    training, others = made_up(60, 1), made_up(20, 2)
    found = fit(quick_scenario().station_keeping(), training, others)
    path = tmp_path_factory.mktemp("ideal") / "ideal-weights.nc"
    return save(ideal_record(quick_scenario(), found, training, others), path)


def test_the_file_holds_everything_that_was_used(file: Path) -> None:
    record = load(file)
    training, others = made_up(60, 1), made_up(20, 2)
    found = fit(quick_scenario().station_keeping(), training, others)
    np.testing.assert_array_equal(record["zeta"], training.states)
    np.testing.assert_array_equal(record["value"], training.values)
    np.testing.assert_array_equal(record["costate"], training.gradients)
    np.testing.assert_array_equal(record["held_out_zeta"], others.states)
    np.testing.assert_array_equal(record["held_out_costate"], others.gradients)
    np.testing.assert_array_equal(record["ideal_weights"], found.weights)
    sigma = quick_scenario().station_keeping().functions.sigma
    fitted = [found.weights @ sigma(zeta)[0] for zeta in others.states]
    np.testing.assert_allclose(record["epsilon"], others.values - fitted, atol=1e-9)
    for name in ("epsilon", "epsilon_prime", "policy"):
        for size, value in asdict(getattr(found, name)).items():
            assert record.attrs[f"{name}_{size}"] == value
    for variable in record.data_vars.values():
        assert variable.attrs["units"]
    assert record.attrs["basis"] == "quadratic"


def test_the_learner_starts_from_the_file(file: Path) -> None:
    weights = load(file)["ideal_weights"].values
    np.testing.assert_array_equal(load_weights(file), weights)
    scenario = quick_scenario(f"learner.weights='{file}'", "learner.weight_factor=0.5")
    np.testing.assert_allclose(scenario.initial_weights(), 0.5 * weights)
    station = scenario.station_keeping()
    learner = Learner(
        station.problem,
        station.basis,
        scenario.learner,
        np.empty((0, 12)),
        station.riccati_weights,
        scenario.initial_weights(),
        station.functions,
    )
    zeta = made_up(20, 2).states[3]
    assert learner.value(zeta) == pytest.approx(
        0.5 * (made_up(20, 2).values[3] - load(file)["epsilon"].values[3])
    )


def test_another_basis_refuses_the_file(file: Path, one_sentence: Check) -> None:
    scenario = quick_scenario("basis.name=drag", f"learner.weights='{file}'")
    with pytest.raises(InputError, match="78 weights, but basis 'drag' has 144") as caught:
        scenario.initial_weights()
    one_sentence(caught.value)


def test_bounds(file: Path) -> None:
    bounds = load_ideal(quick_scenario(), file).bounds
    record = load(file)
    assert bounds.epsilon == pytest.approx(np.abs(record["epsilon"].values).max())
    norms = np.linalg.norm(record["epsilon_prime"].values, axis=1)
    assert bounds.epsilon_prime == pytest.approx(norms.max())
    assert bounds.n_states == 20
    assert (
        load_ideal(quick_scenario("learner.rule='gradient'", "samples.seed=4"), file).bounds == bounds
    )


@pytest.mark.parametrize("override", ["game.gamma=3", "envelope.scale=0.5", "basis.name=drag"])
def test_bounds_of_another_scenario_are_refused(override: str, file: Path, one_sentence: Check) -> None:
    with pytest.raises(InputError, match="belong to another") as caught:
        load_ideal(quick_scenario(override), file)
    one_sentence(caught.value)


def test_bounds_of_what_is_no_such_file(tmp_path: Path, one_sentence: Check) -> None:
    (tmp_path / "noise.nc").write_bytes(b"noise")
    for name in ("none.nc", "noise.nc"):
        with pytest.raises(InputError, match=name) as caught:
            load_ideal(quick_scenario(), tmp_path / name)
        assert "--ideal-weights" in one_sentence(caught.value)


def found_in(conditions: list[Condition], words: str) -> Condition:
    (found,) = [c for c in conditions if words in c.paper]
    return found


def test_24_and_25_share_an_epsilon() -> None:
    """With a gain that makes (25) possible: each bound is the printed one at the other's ε."""
    actor_gains = ("learner.gain_actor_1=2", "learner.gain_actor_2=2")
    scenario = quick_scenario("learner.rule='gradient'", "learner.gain_critic=1e9", *actor_gains)
    station = scenario.station_keeping()
    L_f, gain = drift_bound(station, 500), 1e9
    plain = check(scenario)
    margin = found_in(plain, "(25)").value
    known = found_in(plain, "(25)").bound
    assert margin is not None
    assert known == pytest.approx(4.0 / (2.0 * gain))
    assert margin > known
    q_lower = 20.0
    # ε' for which both hold with something to spare, and ten times that, for which none does
    limit = 2.0 * np.sqrt(q_lower * (margin - known) / gain) / L_f
    for factor, holds in ((0.5, True), (10.0, False)):
        bounds = Bounds(7.0, float(factor * limit), 9)
        conditions = scenario_conditions(scenario, bounds)
        first, second = found_in(conditions, "(24)"), found_in(conditions, "(25)")
        least = L_f * bounds.epsilon_prime / (2.0 * (margin - known))
        largest = 2.0 * q_lower / (gain * L_f * bounds.epsilon_prime)
        assert first.bound == pytest.approx(gain * L_f * bounds.epsilon_prime * least / 2.0)
        assert second.bound == pytest.approx(L_f * bounds.epsilon_prime / (2.0 * largest) + known)
        assert first.holds is second.holds is bool(least < largest) is holds
        third = found_in(conditions, "Assumption 3")
        assert (third.value, third.holds) == (7.0, True)
        assert "9 states" in third.note


def test_no_epsilon_helps_where_25_fails_without_it() -> None:
    conditions = scenario_conditions(quick_scenario(), Bounds(1.0, 10.0, 5))
    first, second = found_in(conditions, "(24)"), found_in(conditions, "(25)")
    assert (first.bound, first.holds, second.holds) == (None, None, False)
    L_f = drift_bound(quick_scenario().station_keeping(), 500)
    assert f"{2 * 20.0 / (L_f * 10.0):.3g}" in first.note


def test_states_without_certificate_are_left_out(tmp_path: Path) -> None:
    scenario = Scenario.load("bluerov2-heavy", [*QUICK, *TINY, *LOOSE])
    tight = scenario.with_settings(offline={"value_tolerance": 1e-16})
    states = envelope_states(scenario.station_keeping().envelope, 3, 1, TRAINING)
    optima = Optima(scenario, states, tmp_path)
    optima.solve(1, lambda done, solved: None)
    pairs, faults = certified_pairs(optima, {1: "its process was killed"})
    assert faults == ["its process was killed"]
    np.testing.assert_array_equal(pairs.states, states[[0, 2]])
    record = load(tmp_path / "optimal-3.nc")
    assert pairs.values[1] == record.attrs["value"]
    np.testing.assert_array_equal(pairs.gradients[1], record["costate"])
    failing = Optima(tight, states[:1], tmp_path / "tight")
    failing.solve(1, lambda done, solved: None)
    with pytest.raises(RunError, match=r"none of 1 states is certified.*value_error"):
        certified_pairs(failing, {})


@pytest.mark.slow
def test_the_command(tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("offline", "--quiet", "--ideal-weights", "14", "--held-out", "3", "--workers", "1")
    answer = call(capsys, *words, "--json", "--out", "out", *SETTINGS)
    assert answer.code == 0, answer.err
    told = answer.json()
    assert len(told["states"]) == 1
    ideal = told["ideal_weights"]
    assert (ideal["n_states"], ideal["held_out"]) == (14, 3)
    assert ideal["faults"] == []
    assert ideal["file"] == "out/ideal-weights.nc"
    for name in ("epsilon", "epsilon_prime", "policy"):
        assert set(ideal[name]) == {"sup", "rms", "sup_relative", "rms_relative"}
        assert 0.0 < ideal[name]["rms"] <= ideal[name]["sup"]
        assert 0.0 < ideal[name]["rms_relative"] <= ideal[name]["sup_relative"]
    record = load(tmp_path / "out" / "ideal-weights.nc")
    assert record.sizes["sample"] == 14
    assert record.sizes["held_out"] == 3
    assert record.attrs["epsilon_prime_sup"] == ideal["epsilon_prime"]["sup"]
    names = files_in(tmp_path / "out" / "ideal-weights")
    assert len([name for name in names if name.startswith("training/")]) == 14
    assert len([name for name in names if name.startswith("held-out/")]) == 3
    again = call(capsys, *words, "--out", "out", *SETTINGS)
    assert again.code == 0
    text = " ".join(again.out.split())
    for word in ("'quadratic'", "14 states", "3 others", f"{ideal['policy']['rms']:.3g}", "ε'"):
        assert word in text
    checked = call(
        capsys, "check", "--quiet", "--json", "--ideal-weights", "out/ideal-weights.nc", *SETTINGS
    )
    (third,) = [c for c in checked.json()["conditions"] if c["paper"] == "Assumption 3"]
    assert third["value"] == ideal["epsilon"]["sup"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--held-out", "5"), ["--held-out 5", "--ideal-weights N"]),
        (("--ideal-weights", "0"), ["--ideal-weights is 0", "at least 12"]),
        (("--ideal-weights=-5",), ["--ideal-weights is -5"]),
        (("--ideal-weights", "11"), ["78 weights", "'quadratic'", "at least 12"]),
        (("--ideal-weights", "20", "--held-out", "0"), ["--held-out is 0"]),
    ],
)
def test_bad_numbers(
    words: tuple[str, ...],
    told: list[str],
    tmp_path: Path,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = call(capsys, "offline", "--quiet", *words, *SETTINGS)
    assert answer.code == 2
    text = answer.sentence()
    for word in told:
        assert word in text, text
    assert files_in(tmp_path) == []


@pytest.mark.slow
def test_the_basis_that_knows_drag_is_closer_to_the_value(tmp_path: Path) -> None:
    """Certified pairs at 0.35 of the envelope, relative errors on others."""
    scenario = Scenario.load("bluerov2-heavy")
    envelope = scenario.station_keeping().envelope
    sets_of_pairs: list[Pairs] = []
    for stream, n in ((TRAINING, 60), (HELD_OUT, 25)):
        optima = Optima(scenario, envelope_states(envelope, n, 0, stream), tmp_path / str(stream))
        optima.solve(1, lambda done, solved: None)
        pairs, faults = certified_pairs(optima, {})
        assert faults == []
        sets_of_pairs.append(pairs)
    found = {}
    for name in ("quadratic", "drag"):
        station = Scenario.load("bluerov2-heavy", [f"basis.name={name}"]).station_keeping()
        found[name] = fit(station, *sets_of_pairs)
    linear: Array = scenario.station_keeping().problem.P
    others = sets_of_pairs[1]
    error = (others.gradients - 2.0 * others.states @ linear) * HALF_WIDTHS
    relative = np.linalg.norm(error, axis=1) / np.linalg.norm(others.gradients * HALF_WIDTHS, axis=1)
    assert found["drag"].epsilon_prime.rms_relative < 0.03
    assert 0.08 < found["quadratic"].epsilon_prime.rms_relative < np.sqrt(np.mean(relative**2))
    assert found["drag"].epsilon.rms_relative < 0.02
    assert found["drag"].policy.rms_relative < 0.3 * found["quadratic"].policy.rms_relative
