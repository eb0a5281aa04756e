"""What the paper asks of any problem: an envelope inside the domain, and f(0) = 0."""

from __future__ import annotations

from itertools import product

import casadi
import numpy as np

from ...offline import Plant
from ...online import draw_samples
from ...symbolic import Setup
from .condition import Condition


def domain_conditions(setup: Setup, n_points: int = 2000, seed: int = 0) -> list[Condition]:
    """Return for each bound of the problem's domain how near the envelope comes to it.

    At seeded points of the envelope and, for up to twelve states, at its corners.
    """
    problem = setup.problem
    points = draw_samples(setup.envelope, n_points, seed)
    if problem.n_states <= 12:
        signs = np.array(list(product((-1.0, 1.0), repeat=problem.n_states)))
        points = np.vstack([points, setup.envelope * signs])
    listed = []
    for number, bound in enumerate(problem.domain, 1):
        parts = [bound.margin, bound.margin if bound.shown is None else bound.shown]
        function = casadi.Function("bound", [problem.zeta], parts)
        margin, shown = (np.array(part).ravel() for part in function.map(len(points))(points.T))
        least = int(margin.argmin())
        said = bound.sentence.format(f"{shown[least]:.4g}")
        listed.append(
            Condition(
                "the envelope lies in the domain"
                + (f", bound {number}" if len(problem.domain) > 1 else ""),
                "Assumption 1",
                float(margin[least]),
                0.0,
                bool(margin[least] > 0.0),
                f"least margin over points of the envelope; the bound says: '{said}'",
            )
        )
    return listed


def equilibrium(setup: Setup) -> Condition:
    """Return Assumption 2, f(0) = 0, of any problem."""
    f, _ = Plant(setup.problem).terms(np.zeros(setup.problem.n_states))
    residual = float(np.linalg.norm(f))
    return Condition(
        "f(0) = 0",
        "Assumption 2",
        residual,
        0.0,
        residual < 1e-9,
        "|f(0)|; the origin is an equilibrium without input",
    )
