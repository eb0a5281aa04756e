"""A basis of one's own: the fourth powers beside the quadratic monomials.

A basis is a function of the scaled state x = ζ / half-widths, in a scenario as
`basis.name = "examples/own_basis.py:sigma"`, or with --set in any command. Here it is exact, since the
plant is made backwards from its value: with V = x^2 + x^4 / 2 and k = 1/R - γ^-2 the HJI says
f = k V'/4 - x^2 / V'.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray
from stationkeep import Game, Problem, Scenario, simulate
from stationkeep.online import LearnedPolicy
from stationkeep.symbolic import quadratic

START = 0.9


def sigma(x: SX) -> SX:
    """Return x_i x_j and x_i^4, shape (n (n + 1) / 2 + n,)."""
    return casadi.vertcat(quadratic(x), x**4)


def problem() -> Problem:
    """Return x_dot = f(x) + u_1 + u_2, whose value is x^2 + x^4 / 2."""
    x = SX.sym("x", 1)
    game = Game(np.eye(1), np.eye(1), np.eye(1), gamma=2.0)
    k = 1.0 - game.gamma**-2
    drift = k * x * (1 + x**2) / 2 - x / (2 * (1 + x**2))
    return Problem("cubic spring", x, drift, SX(1.0), game, np.ones(1))


def learned(basis: str) -> tuple[NDArray[np.float64], float]:
    """Return the weights that a run of 6 s from x = 0.9 ends with, and the value there by them."""
    scenario = Scenario.load(f"{__file__}:problem", [f"basis.name='{basis}'"])
    policy = LearnedPolicy(scenario)
    simulate(problem(), policy, [START], duration=6.0)
    return policy.learner.critic, policy.learner.value(np.array([START]))


def main() -> tuple[NDArray[np.float64], float]:
    """Return the weights on x^2 and x^4 and the value; print those of the quadratic basis, too."""
    weights, value = learned(f"{__file__}:sigma")
    print(f"V*(0.9) = {START**2 + START**4 / 2:.4f}; own basis: {value:.4f} with the weights {weights}")
    print("quadratic basis: {1:.4f} with the weight {0}".format(*learned("quadratic")))
    return weights, value


if __name__ == "__main__":
    main()
