"""The transcription's own derivatives against those that CasADi makes of the same program."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from casadi import MX
from stationkeep.offline.direct import PointDerivatives, Transcription
from stationkeep.offline.direct.stage import single_player
from stationkeep.symbolic import Problem

from .games import two_state


@pytest.mark.parametrize("n_intervals", [1, 3])
@pytest.mark.parametrize("game", ["two states", "shipped"])
@pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "virtual machine"])
def test_derivatives_are_those_of_the_program(
    game: str, n_intervals: int, compiled: bool, reference_problem: Problem
) -> None:
    problem = reference_problem if game == "shipped" else two_state()[0]
    stage = single_player(problem)
    program = Transcription(
        stage, n_intervals, 2, derivatives=PointDerivatives(stage, compiled=compiled)
    )
    solver, rng = program.solver, np.random.default_rng(0)
    f, g = (solver.get_function(name) for name in ("nlp_f", "nlp_g"))
    x, p = (MX.sym(name, f.size1_in(i)) for i, name in enumerate("xp"))
    sigma, multipliers = MX.sym("sigma"), MX.sym("multipliers", g.size1_out(0))
    lagrangian = sigma * f(x, p) + casadi.dot(multipliers, g(x, p))
    exact = casadi.Function(
        "exact",
        [x, p, sigma, multipliers],
        [casadi.jacobian(g(x, p), x), casadi.triu(casadi.hessian(lagrangian, x)[0])],
    )
    arguments = [rng.uniform(-0.3, 0.3, x.shape[0]), rng.uniform(0.2, 1.0, p.shape[0])]
    weights = [1.7, rng.standard_normal(g.size1_out(0))]
    jacobian, hessian = (np.array(value) for value in exact(*arguments, *weights))
    ours = np.array(solver.get_function("nlp_jac_g")(*arguments)[1])
    np.testing.assert_allclose(ours, jacobian, atol=1e-12 * np.abs(jacobian).max())
    curvature = np.array(solver.get_function("nlp_hess_l")(*arguments, *weights))
    np.testing.assert_allclose(curvature, hessian, atol=1e-12 * np.abs(hessian).max())
