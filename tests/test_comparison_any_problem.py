"""Conditions, optima, weights and learning of a problem that is no vehicle, against closed forms."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from stationkeep.comparison.optima import unit_text
from stationkeep.comparison.optima.ideal import effort, fit
from stationkeep.comparison.theory.conditions import drift_bound
from stationkeep.comparison.theory.problem_conditions import domain_conditions, equilibrium
from stationkeep.offline import Pairs
from stationkeep.symbolic import Basis, Bound, Setup, quadratic, two_state_game

from .games import TWO_STATE_WEIGHTS, Array

ENVELOPE = np.array([1.0, 0.5])


@cache
def setup(limit: float | None = None) -> Setup:
    """The exact two-state game, V* = x1^2 / 2 + x2^2, and |x1| < `limit` where there is one."""
    problem = two_state_game()
    if limit is not None:
        sentence = "x1 is {}, but must stay within the limit; start closer"
        bound = Bound(limit**2 - problem.zeta[0] ** 2, sentence, problem.zeta[0])
        problem = replace(problem, domain=(bound,))
    basis = Basis.build("quadratic", quadratic, problem.zeta, np.ones(2))
    return Setup(problem=problem, basis=basis, envelope=ENVELOPE, compiled=False)


def drift(zeta: Array) -> Array:
    """f of the game with R = 1 and γ = 2, k = 3/4, row by row."""
    x1, x2 = zeta.T
    c = np.cos(2.0 * x1) + 2.0
    return np.stack([-x1 + x2, -0.5 * x1 - 0.5 * x2 * (1.0 - 0.75 * c**2)], axis=1)


def test_the_bound_of_the_drift_is_the_largest_on_a_fine_grid() -> None:
    axes = [np.linspace(-half, half, 801) for half in ENVELOPE]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    grid = grid[np.linalg.norm(grid, axis=1) > 1e-9]
    brute = (np.linalg.norm(drift(grid), axis=1) / np.linalg.norm(grid, axis=1)).max()
    assert drift_bound(setup(), 500) == pytest.approx(brute, rel=1e-3)


def test_an_equilibrium_and_no_bound() -> None:
    found = equilibrium(setup())
    assert (found.value, found.holds) == (0.0, True)
    assert domain_conditions(setup()) == []


@pytest.mark.parametrize(("limit", "holds"), [(1.5, True), (0.8, False)])
def test_how_near_the_envelope_comes_to_the_domain(limit: float, holds: bool) -> None:
    """The margin limit^2 - x1^2 is least at the corners, where |x1| = 1."""
    (found,) = domain_conditions(setup(limit))
    assert found.value == pytest.approx(limit**2 - 1.0)
    assert found.holds is holds
    assert "must stay within the limit" in found.note


def test_ideal_weights_of_the_exact_basis_are_the_closed_form() -> None:
    rng = np.random.default_rng(3)
    training, held_out = (
        Pairs(x, 0.5 * x[:, 0] ** 2 + x[:, 1] ** 2, x * np.array([1.0, 2.0]))
        for x in (ENVELOPE * rng.uniform(-1.0, 1.0, (n, 2)) for n in (20, 7))
    )
    found = fit(setup(), training, held_out)
    np.testing.assert_allclose(found.weights, TWO_STATE_WEIGHTS, atol=1e-9)
    assert found.epsilon.sup < 1e-9
    # v = -k/2 c V_x2 with V_x2 = 2 x2, and v'R_eff v = v^2 / k
    x = held_out.states
    v = -0.75 * (np.cos(2.0 * x[:, 0]) + 2.0) * x[:, 1]
    np.testing.assert_allclose(effort(setup(), x, held_out.gradients), np.sqrt(v**2 / 0.75))


def test_each_unit_is_told_once() -> None:
    assert unit_text(("m", "m", "rad", "m")) == "m, rad"
    assert unit_text(setup().problem.state_units) == "1"
