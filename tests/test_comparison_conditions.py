"""`check`: every number of the paper's conditions against an independent computation."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import differential_evolution, minimize
from stationkeep.comparison import Condition, check
from stationkeep.comparison.theory.conditions import drift_bound
from stationkeep.comparison.theory.vehicle_conditions import inertia_bounds
from stationkeep.online import draw_samples
from stationkeep.symbolic import StationKeeping, Vehicle

from .games import Array, quick_scenario


@cache
def conditions(*overrides: str) -> dict[str, Condition]:
    """Return the conditions of the quick scenario by where the paper has them and their names."""
    return {f"{c.paper}: {c.name}": c for c in check(quick_scenario(*overrides))}


def one(words: str, *overrides: str) -> Condition:
    """Return the one condition whose place or name holds the words."""
    (found,) = [c for key, c in conditions(*overrides).items() if words in key]
    return found


def inertia(M: Array, phi: float, theta: float) -> Array:
    """Return M_bar = J^-T M J^-1 at zero yaw, from the rotations about y and x."""
    cf, sf, ct, st = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta)
    pitch = np.array([[ct, 0, st], [0, 1, 0], [-st, 0, ct]])
    roll = np.array([[1, 0, 0], [0, cf, -sf], [0, sf, cf]])
    J_inverse = np.zeros((6, 6))
    J_inverse[:3, :3] = (pitch @ roll).T
    J_inverse[3:, 3:] = [[1, 0, -st], [0, cf, ct * sf], [0, -sf, ct * cf]]
    return np.asarray(J_inverse.T @ M @ J_inverse)


@pytest.mark.parametrize(
    ("vehicle", "limit"), [("bluerov2-heavy", 75.0), ("bluerov2-heavy", 30.0), ("rexrov", 60.0)]
)
def test_bounds_of_the_inertia_by_brute_force(vehicle: str, limit: float) -> None:
    """Property 1: no attitude inside the limit leaves the bounds, and some come close to them."""
    M, edge = Vehicle.load(vehicle).M, np.radians(limit)
    station = quick_scenario(f"vehicle={vehicle}").station_keeping()
    low, high = inertia_bounds(station, edge)
    rng = np.random.default_rng(0)
    attitudes = np.column_stack([rng.uniform(-np.pi, np.pi, 4000), rng.uniform(-edge, edge, 4000)])
    attitudes[:400, 1] = np.sign(attitudes[:400, 1]) * edge
    spectra = np.array([np.linalg.eigvalsh(inertia(M, *attitude)) for attitude in attitudes])
    best = attitudes[spectra[:, 0].argmin()]
    refined = minimize(
        lambda a: float(np.linalg.eigvalsh(inertia(M, a[0], a[1]))[0]),
        best,
        bounds=[(-4.0, 4.0), (-edge, edge)],
    )
    assert low == pytest.approx(min(refined.fun, spectra[:, 0].min()), rel=5e-3)
    assert high == pytest.approx(spectra[:, -1].max(), rel=1e-3)
    assert spectra[:, 0].min() >= low * (1.0 - 5e-3)
    assert spectra[:, -1].max() <= high * (1.0 + 1e-3)


def test_property_1_in_the_list() -> None:
    low, high = one("m_lower"), one("m_upper")
    bounds = inertia_bounds(quick_scenario().station_keeping(), np.radians(75.0))
    assert (low.value, high.value) == bounds
    assert low.holds is high.holds is True
    assert f"{1.0 / bounds[0]:.3g}" in high.note
    assert "0 at 90 deg" in low.note


def test_the_lower_bound_vanishes_towards_90_degrees() -> None:
    station = quick_scenario().station_keeping()
    lows = [inertia_bounds(station, np.radians(limit))[0] for limit in (60.0, 80.0, 89.0)]
    assert lows[0] > 5.0 * lows[1] > 25.0 * lows[2] > 0.0


def test_pitch_limit() -> None:
    limit = one("Assumption 1", "simulation.pitch_limit=60")
    assert (limit.value, limit.bound, limit.holds) == (60.0, 90.0, True)


@pytest.mark.parametrize(("gamma", "expected"), [(2.0, 0.075), (4.0, 0.09375)])
def test_26_as_printed_fails_where_the_corrected_holds(gamma: float, expected: float) -> None:
    """R = diag(1, 1, 1, 10, 10, 10), W_d = R: R^-1 (1 - γ^-2) has the least eigenvalue of a moment."""
    override = f"game.gamma={gamma}"
    printed, corrected = one("as printed", override), one("corrected", override)
    assert printed.value == pytest.approx(1.0)
    assert printed.bound == pytest.approx(gamma**2)
    assert printed.holds is False
    assert "wrong way" in printed.note
    assert corrected.value == pytest.approx(expected)
    assert corrected.bound == 0.0
    assert corrected.holds is True


def test_26_of_a_full_weight() -> None:
    """Eigenvalues, not entries: R and W_d turned by a rotation keep theirs."""
    turn, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((6, 6)))
    R = turn @ np.diag([1.0, 2, 3, 4, 5, 6]) @ turn.T
    R = 0.5 * (R + R.T)
    overrides = (f"game.R={R.tolist()}", "game.W_d=[1,1,1,1,1,1]", "game.gamma=3")
    assert one("as printed", *overrides).value == pytest.approx(1.0)
    assert one("corrected", *overrides).value == pytest.approx(1.0 / 6.0 - 1.0 / 9.0)


def test_gamma_star() -> None:
    star = one("γ > γ*")
    assert star.value == 2.0
    assert star.bound == pytest.approx(1.0, abs=1e-6)
    assert star.holds is True
    other = one("γ > γ*", "game.W_d=[1,1,1,1,1,1]", "game.gamma=4")
    assert other.bound == pytest.approx(np.sqrt(10.0), abs=1e-5)


def monomial_jacobian(x: Array, scale: Array) -> Array:
    """Return the gradients of x_i x_j, i <= j, with respect to ζ = scale · x, row by row."""
    rows = []
    for i in range(12):
        for j in range(i, 12):
            row = np.zeros(12)
            row[i] += x[j]
            row[j] += x[i]
            rows.append(row / scale)
    return np.array(rows)


@cache
def regressors(overrides: tuple[str, ...] = ()) -> Array:
    """Return ω_j = σ'(f + g (u_1 + u_2)) at the samples under the linear value ζ'P ζ."""
    scenario = quick_scenario(*overrides)
    station: StationKeeping = scenario.station_keeping()
    samples, game, P = scenario.samples, station.game, station.problem.P
    points = draw_samples(station.envelope, samples.number, samples.seed, inner=samples.inner)
    rows = []
    for zeta in points:
        f, g = station.model.drift(zeta), station.model.input_matrix(zeta)
        push = g.T @ (2.0 * P @ zeta)
        u_control = -0.5 * np.linalg.solve(game.R, push)
        u_disturbance = 0.5 * np.linalg.solve(game.W_d, push) / game.gamma**2
        rate = f + g @ (u_control + u_disturbance)
        rows.append(monomial_jacobian(zeta / station.half_widths, station.half_widths) @ rate)
    return np.array(rows)


def test_rank_of_18() -> None:
    rank = one("rank of (18)")
    omega = regressors()
    assert omega.shape == (200, 78)
    assert rank.value == np.linalg.matrix_rank(omega)
    assert (rank.value, rank.bound, rank.holds) == (78.0, 78.0, True)


@pytest.mark.parametrize("number", [1, 77])
def test_too_few_samples_have_too_low_a_rank(number: int) -> None:
    overrides = (f"samples.number={number}",)
    rank = one("rank of (18)", *overrides)
    assert rank.value == np.linalg.matrix_rank(regressors(overrides)) == number
    assert rank.holds is False
    assert one("c_lower > 0", *overrides).holds is False


def test_no_samples() -> None:
    rank = one("rank of (18)", "samples.number=0")
    assert (rank.value, rank.holds) == (0.0, False)
    assert "samples.number" in rank.note
    assert one("(25)", "samples.number=0").holds is False


def test_margin_of_18() -> None:
    """λ_min(Σ ω ω'/p), p = sqrt(1 + ω'ω), as the smallest singular value squared of the rows."""
    omega = regressors()
    rows = omega / (1.0 + np.sum(omega**2, axis=1, keepdims=True)) ** 0.25
    singular = np.linalg.svd(rows, compute_uv=False)
    margin = one("c_lower > 0")
    assert margin.value == pytest.approx(singular[-1] ** 2, rel=1e-6)
    assert f"{singular[0] ** 2:.3g}" in margin.note
    assert margin.holds is True
    norms = np.linalg.norm(omega, axis=1)
    bounded = one("|ω / p|")
    assert bounded.value == pytest.approx((norms / np.sqrt(1.0 + norms**2)).max())
    assert bounded.holds is True


def test_gain_conditions() -> None:
    """(24) waits for ε'; the known part of (25) is (16 + 16) / (2 · 1), which no margin reaches."""
    first, second = one("(24)"), one("(25)")
    assert first.value == pytest.approx(20.0)
    assert first.holds is None
    assert second.bound == pytest.approx(16.0)
    assert second.value == pytest.approx(one("c_lower > 0").value, rel=1e-6)
    assert second.holds is False
    slow = one("(25)", "learner.gain_actor_1=1", "learner.gain_actor_2=3", "learner.gain_critic=8")
    assert slow.bound == pytest.approx(0.25)


def test_drift_bound() -> None:
    station = quick_scenario().station_keeping()
    points = draw_samples(station.envelope, 500, 0)

    def ratio(x: Array) -> float:
        zeta = station.envelope * x
        return float(np.linalg.norm(station.model.drift(zeta)) / np.linalg.norm(zeta))

    found = drift_bound(station, 500)
    assert found > 1.1 * max(ratio(p / station.envelope) for p in points), "samples miss the supremum"
    best = differential_evolution(lambda x: -ratio(x), [(-1.0, 1.0)] * 12, seed=1, maxiter=150)
    assert found == pytest.approx(-best.fun, rel=1e-3)
    assert f"L_f = {found:.4g}" in one("(24)").note


def test_equilibrium() -> None:
    assert one("Assumption 2").value == pytest.approx(0.0, abs=1e-12)
    assert one("Assumption 2").holds is True
    heavy = one("Assumption 2", "vehicle=bluerov2-heavy-buoyant", "samples.number=0")
    # (W - B) / (m + added mass in heave)
    assert heavy.value == pytest.approx((132.57 - 131.59) / (13.5 + 18.68))
    assert heavy.holds is False
    assert "-0.98" in heavy.note


def test_what_is_not_known_is_not_claimed() -> None:
    assert one("Assumption 3").holds is None
    for condition in conditions().values():
        assert condition.note
        assert (condition.value is None) <= (condition.holds is None)
