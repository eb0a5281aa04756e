"""The quick value against values in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from stationkeep.offline import MeshSettings, QuickValue
from stationkeep.symbolic import InputError

from .games import FAR_STATE, linear_quadratic, two_state


@pytest.mark.parametrize("settings", [MeshSettings.quick, MeshSettings.fine])
def test_quick_value_of_the_two_state_game(settings: MeshSettings) -> None:
    """V* = ζ_1^2 / 2 + ζ_2^2."""
    quick = QuickValue(two_state()[0], settings)
    for zeta in np.random.default_rng(4).uniform(-1.0, 1.0, (4, 2)):
        expected = 0.5 * zeta[0] ** 2 + zeta[1] ** 2
        assert quick(zeta) == pytest.approx(expected, rel=2e-6)
        value, costate = quick.with_costate(zeta)
        assert value == quick(zeta)
        np.testing.assert_allclose(costate, [zeta[0], 2.0 * zeta[1]], rtol=1e-4, atol=1e-5)


def test_quick_value_of_a_linear_quadratic_game() -> None:
    problem, _, _ = linear_quadratic()
    found = QuickValue(problem).solution(FAR_STATE)
    assert found.value == pytest.approx(FAR_STATE @ problem.P @ FAR_STATE, rel=2e-6)
    np.testing.assert_allclose(found.trajectory.mesh, MeshSettings.quick.points)
    assert np.isnan(found.defect)


def test_quick_value_refuses_a_state_that_is_none() -> None:
    with pytest.raises(InputError, match="2 numbers"):
        QuickValue(two_state()[0])(np.ones(3))
