"""The learner's compiled vector code: equal to numpy's rows, and to the exact flow however stiff."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.online import Learner, draw_samples
from stationkeep.online.laws import LeastSquares, NormalEquations, exact_flow
from stationkeep.online.rows import BellmanRows, VectorBellmanRows
from stationkeep.online.rows.vector_rows import VectorEquations
from stationkeep.online.vector import compiled, largest_covariance, library
from stationkeep.symbolic.compiled.compilation import find_compiler

from .games import Array, quick_scenario, random_weights

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler")
ZETA = np.array([0.6, -0.3, 0.2, 0.1, -0.1, 0.3, 0.1, 0.05, -0.1, 0.05, 0.1, -0.1])


def two_learners(n_samples: int = 203, **settings: object) -> tuple[Learner, Learner]:
    """Return a learner by vector code and one by numpy, with the same random weights."""
    scenario = quick_scenario("learner.error=bellman", "learner.safeguard=false")
    station = scenario.station_keeping()
    chosen = scenario.learner.model_copy(update=settings)
    points = draw_samples(station.envelope, n_samples, 3)
    learners = [
        Learner(
            station.problem,
            station.basis,
            chosen,
            points,
            station.riccati_weights,
            None,
            station.functions,
        )
        for _ in range(2)
    ]
    for learner in learners:
        weights = random_weights(5, station.basis.n_basis)
        scale = 0.2 * np.abs(station.riccati_weights).mean()
        learner.critic, learner.actor_1, learner.actor_2 = (
            station.riccati_weights + scale * w for w in weights
        )
    fast, slow = learners
    assert isinstance(slow.source, VectorBellmanRows)
    slow.source = slow.source.plain
    return fast, slow


def close(a: Array, b: Array, tolerance: float) -> None:
    assert np.linalg.norm(a - b) <= tolerance * np.linalg.norm(b)


@pytest.mark.parametrize("normalizer", ["paper", "state_cost"])
@pytest.mark.parametrize("n_samples", [1, 15, 203])
def test_rows_are_those_of_numpy(normalizer: str, n_samples: int) -> None:
    """Errors, gradient and normal matrix, whatever is left over in the last vector."""
    fast, slow = two_learners(n_samples, normalizer=normalizer, gain_samples=0.3)
    seen = fast.observe(ZETA)
    equations = seen.rows
    expected = slow.observe(ZETA)
    reference = expected.rows
    assert isinstance(equations, VectorEquations)
    assert isinstance(reference, NormalEquations)
    assert seen.bellman_error == pytest.approx(expected.bellman_error, rel=1e-12)
    assert seen.sample_error == pytest.approx(expected.sample_error, rel=1e-12)
    close(equations.gradient, reference.gradient, 1e-11)
    close(equations.matrix, reference.matrix, 1e-12)


@pytest.mark.parametrize("stiffness", [0.0, 1e-3, 1.0, 10.0, 100.0, 350.0, 1e4])
@pytest.mark.parametrize("leash", [0.0, 0.01])
def test_flow_is_the_exact_one(stiffness: float, leash: float) -> None:
    """η dt λ_max from nothing to where no small Krylov space is enough."""
    fast, _ = two_learners(leash=leash)
    equations = fast.observe(ZETA).rows
    dt = stiffness / float(np.linalg.eigvalsh(equations.matrix)[-1])
    exact = exact_flow(equations.matrix, equations.gradient, dt)
    # what rounding leaves of the eigenvectors' own answer is 1e-10 where much of y has decayed
    close(equations.flow(dt), exact, 1e-10)


def test_flow_of_nothing_is_nothing() -> None:
    fast, _ = two_learners(gain_critic=0.0, gain_samples=0.0, leash=0.0)
    equations = fast.observe(ZETA).rows
    np.testing.assert_array_equal(equations.flow(0.1), np.zeros(fast.basis.n_basis))


@pytest.mark.parametrize("rule", ["gradient", "least_squares"])
def test_learning_steps_are_those_of_numpy(rule: str) -> None:
    fast, slow = two_learners(rule=rule)
    for i in range(5):
        first, second = (learner.step((1.0 - 0.1 * i) * ZETA, 0.05) for learner in (fast, slow))
        assert first.bellman_error == pytest.approx(second.bellman_error, rel=1e-6)
    close(fast.critic, slow.critic, 1e-8)
    close(fast.actor_1, slow.actor_1, 1e-8)


@pytest.mark.parametrize("m", [1, 2, 7, 78])
@pytest.mark.parametrize("spread", [0.0, 10.0])
def test_largest_covariance_is_the_least_eigenvalue_of_the_information(m: int, spread: float) -> None:
    rng = np.random.default_rng(m)
    basis, _ = np.linalg.qr(rng.standard_normal((m, m)))
    eigenvalues = 10.0 ** -rng.uniform(0.0, spread, m)
    factor = np.linalg.cholesky((basis * eigenvalues) @ basis.T)
    found = largest_covariance(factor)
    assert found is not None
    # the matrix itself is known to rounding of its largest eigenvalue
    rounding = 1e-15 * m * eigenvalues.max() / eigenvalues.min()
    assert found == pytest.approx(1.0 / eigenvalues.min(), rel=1e-9 + rounding)


def test_covariance_norm_where_lanczos_has_not_converged() -> None:
    """Many directions of which almost nothing is known: a sixteenth vector does not tell them apart."""
    law = LeastSquares(78, 1.0, 1e2, 1e4)
    steps = np.linspace(1.0, 1.1, 78)
    law.step(np.zeros(78), NormalEquations(np.diag(steps), *np.zeros((2, 78))), 1e-3)
    assert largest_covariance(law._factor) is None
    expected = 1.0 / np.linalg.eigvalsh(law.information)[0]
    assert law.covariance_norm == pytest.approx(expected, rel=1e-12)


def test_largest_covariance_of_equal_eigenvalues() -> None:
    assert LeastSquares(30, 1.0, 1e6, 1e8).covariance_norm == pytest.approx(1e6, rel=1e-12)


def test_without_a_compiler_numpy_takes_its_place(
    empty_cache: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    fast, _ = two_learners(n_samples=40)
    fast.step(ZETA, 0.05)
    monkeypatch.setenv("CC", "no-such-cc")
    compiled._library.cache_clear()
    try:
        assert library() is None
        assert largest_covariance(np.eye(3)) is None
        scenario = quick_scenario("learner.error=bellman", "learner.safeguard=false")
        station = scenario.station_keeping()
        law = LeastSquares(5, 1.0, 10.0, 1e4)
        assert law.covariance_norm == pytest.approx(10.0)
        points = draw_samples(station.envelope, 40, 3)
        learner = Learner(
            station.problem, station.basis, scenario.learner, points, station.riccati_weights
        )
        assert isinstance(learner.source, BellmanRows)
    finally:
        compiled._library.cache_clear()
