"""A critic law of one's own: Gauss-Seidel, one weight after the other, on the learner's equations.

Near the present weights the rows say A (W - Ŵ_c) = -b. One sweep solves each line for its own weight
with what is known of the others; sweeps converge for every positive definite A. As a setting it learns
in every command: `stationkeep compare SCENARIO --set learner.rule=examples/own_critic.py:make`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from stationkeep import Scenario, simulate
from stationkeep.online import LearnedPolicy
from stationkeep.online.laws import Equations
from stationkeep.symbolic import Setup, two_state_game

Array = NDArray[np.float64]


class GaussSeidel:
    """Ŵ_c <- Ŵ_c - tril(A)^-1 b, once a learning step."""

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        """Return Ŵ_c after dt [s] with these rows, shape (m,)."""
        return np.asarray(critic - solve_triangular(rows.matrix, rows.gradient, lower=True))


def make(setup: Setup) -> GaussSeidel:
    """Return the law for a problem and its basis; this one needs to know neither."""
    return GaussSeidel()


problem = two_state_game()  # V* = x1^2 / 2 + x2^2: the weights of (x1^2, x1 x2, x2^2) are (1/2, 0, 1)
SETTINGS = (
    f"learner.rule='{__file__}:make'",
    "learner.weight_factor=0.6",  # start from 0.6 of them: Riccati's weights are the exact ones here
    "learner.leash=0.0",  # and let nothing pull there but what is learned
    "envelope.half_widths=[1.0,1.0]",  # the basis is one of the scaled state
)


def main() -> Array:
    """Return the weights that a run of 10 s from (1/2, -1/2) ends with."""
    policy = LearnedPolicy(Scenario.load(f"{__file__}:problem", SETTINGS))
    print("weights at the start", policy.learner.critic)
    simulate(problem, policy, [0.5, -0.5], duration=10.0)
    print("weights at the end", policy.learner.critic)
    return policy.learner.critic


if __name__ == "__main__":
    main()
