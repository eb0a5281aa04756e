"""With an exact basis, ε = 0, the UUB claim becomes asymptotic convergence from an explicit level set.

The printed proof bounds what multiplies W̃_a by a supremum over χ, so its K stays positive. Keeping what
the terms depend on, with s_i = g'σ'^T W̃_ai, D = γ^-2 W_d^-1 and y_j = s_1'R^-1 s_1 - s_2'D s_2 at ζ_j,

    V_L_dot = -ζ'Qζ - V_ζ g R_eff^-1 g'V_ζ'/4 + V_ζ g (R^-1 s_1 - D s_2)/2
              - η_c W̃_c'Λ W̃_c + η_c W̃_c' Σ_j ω_j y_j/(4 p_j) - Σ_i η_ai W̃_ai'(W̃_ai - W̃_c)

with Λ = Σ_j ω_j ω_j'/p_j, the state among the j. Completing squares in the first line and, with
0 < θ < 1, in the second,

    V_L_dot <= -(q - (l_1 |W̃_a1|^2 + l_2 |W̃_a2|^2)/2) |ζ|^2
               - ((1 - θ) η_c c - (η_a1 + η_a2)/2) |W̃_c|^2
               - Σ_i (η_ai/2 - η_c T_i |W̃_ai|^2 / (64 θ)) |W̃_ai|^2,

l_1 = sup λ_max(σ'g R^-1 R_eff R^-1 g'σ'^T) / |ζ|^2, l_2 likewise with D R_eff D,
T_i = sup_χ λ_max(G_σi)^2 + Σ_j λ_max(G_σij)^2 (p >= 1). With (25) some θ is left, and V_L_dot < 0 while
V_L is below `ExactBound.level`: from there Z -> 0. The same holds for the plant ζ_dot = f + g û_1
(d = 0), where the first line is smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...online.paper import BellmanTerms
from ...symbolic import InputError, ValueFunctions
from ...symbolic.arrays import Array
from .uub import Gains, largest_square


@dataclass(frozen=True)
class ExactBound:
    """The constants of the bound above.

    Attributes
    ----------
    theta : θ, half of what (25) leaves
    lift_1, lift_2 : l_i
    fourth_1, fourth_2 : T_i
    level : V_L below which V_L_dot < 0
    """

    theta: float
    lift_1: float
    lift_2: float
    fourth_1: float
    fourth_2: float
    level: float


def exact_bound(
    functions: ValueFunctions, points: Array, samples: Array, gains: Gains, c_lower: float
) -> ExactBound:
    """Return the bound over the points of χ, shape (M, n), with samples ζ_j, shape (N, n).

    χ must hold the states of the level, and `c_lower` be the infimum of λ_min(Λ) on it.

    Raises
    ------
    InputError
        If (25) does not hold.
    """
    game = functions.problem.game
    theta = 0.5 * (1.0 - 0.5 * (gains.actor_1 + gains.actor_2) / (gains.critic * c_lower))
    if not theta > 0.0:
        raise InputError(
            f"(25) fails: the margin {c_lower:.3g} is not above (η_a1 + η_a2) / (2 η_c); slow the "
            "actors down or add samples"
        )
    here = BellmanTerms.at(points, functions.at(points), game)
    there = BellmanTerms.at(samples, functions.at(samples), game)
    size = np.sum(points**2, axis=1)
    players = (game.R_inverse, game.disturbance_inverse)
    lifts = [float((largest_square(here, w @ game.R_eff @ w) / size).max()) for w in players]
    fourths = [
        float((largest_square(here, w) ** 2).max() + (largest_square(there, w) ** 2).sum())
        for w in players
    ]
    speeds = (gains.actor_1 / fourths[0], gains.actor_2 / fourths[1])
    q_lower = float(np.linalg.eigvalsh(game.Q)[0])
    level = float(min(16.0 * theta * min(speeds) / gains.critic, q_lower / max(lifts)))
    return ExactBound(theta, lifts[0], lifts[1], fourths[0], fourths[1], level)
