"""The paper's loop alone: (13)-(21) as printed and scipy, nothing else of the learner.

On the two-state game with V* = x1^2 / 2 + x2^2: the weights of (x1^2, x1 x2, x2^2) are (1/2, 0, 1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from stationkeep.online import draw_samples, paper
from stationkeep.symbolic import Basis, ValueFunctions, quadratic, two_state_game

Array = NDArray[np.float64]
GAIN_CRITIC, GAIN_ACTOR = 1.0, 2.0  # 1/s
PERIOD, DURATION = 0.5, 30.0  # s

problem = two_state_game()
functions = ValueFunctions(problem, Basis.build("quadratic", quadratic, problem.zeta, np.ones(2)))
samples = draw_samples(np.ones(2), 100, seed=0)


def terms(points: Array) -> paper.BellmanTerms:
    """Return what the points (N, 2) alone decide of (14)-(17)."""
    return paper.BellmanTerms.at(points, functions.at(points), problem.game)


at_samples = terms(samples)
inside = paper.Projection(bound=5.0, margin=0.5)


def rates(t: float, y: Array) -> Array:
    """Return the rates of ζ (2,), Ŵ_c, Ŵ_a1 and Ŵ_a2, each (3,)."""
    zeta, critic, actor_1, actor_2 = np.split(y, [2, 5, 8])
    here, game, weights = terms(zeta[None, :]), problem.game, (critic, actor_1, actor_2)
    u_1 = paper.control_policy(here, actor_1, game)  # (14)
    u_2 = paper.disturbance_policy(here, actor_2, game)  # (15)
    error_here = paper.bellman_error(here, game, *weights)  # (16)(17)
    error_there = paper.bellman_error(at_samples, game, *weights)
    at = functions.at(zeta[None, :])
    zeta_dot = at.f[0] + at.g[0] @ (u_1 + u_2)[0]
    critic_dot = paper.critic_rate(error_here, error_there, GAIN_CRITIC)  # (19)
    actor_1_dot = paper.actor_rate(actor_1, critic, GAIN_ACTOR, inside)  # (20)
    actor_2_dot = paper.actor_rate(actor_2, critic, GAIN_ACTOR, inside)  # (21)
    return np.concatenate([zeta_dot, critic_dot, actor_1_dot, actor_2_dot])


def main() -> Array:
    """Return the state and the weights after the run."""
    y = np.concatenate([[1.0, -1.0], np.tile([0.8, 0.1, 0.7], 3)])
    for t in np.arange(0.0, DURATION, PERIOD):
        y = solve_ivp(rates, (t, t + PERIOD), y, method="LSODA", rtol=1e-8, atol=1e-10).y[:, -1]
    print("state", y[:2], "critic", y[2:5])
    return y


if __name__ == "__main__":
    main()
