"""The safeguard: actors move only as far as the model certifies, and never rest on worse than linear.

J(ζ; Ŵ_a1, Ŵ_a2) is the predicted cost of the game from the present state when both players follow
(14)(15). Before a step the actors restart from the reference weights (with the Riccati weights
u_1 = -R^-1 g(ζ)'P ζ) if J there is lower; then they go all, half, a quarter or a tenth of the way that
(20)(21) ask for, the first that lowers J, or stay. Until the next step the policy in use is the
actors', or, where that is predicted to cost less, the linear H-infinity policy u_1 = -K_1 ζ with the
constant gain K_1 = R^-1 g(0)'P. The actors learn on all the same.

Along the model's own trajectory the cost already paid plus the J of the policy in use never rises: no
step raises the lesser J, and between steps the J of the one that is followed falls by exactly what is
paid. So with an exact model a run costs no more than either of the two from its initial state, up to
the horizon. (Policy improvement by rollout, and the best of several base policies at every state:
Bertsekas 2017, Dynamic Programming and Optimal Control I, 6.4.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...symbolic.arrays import Array

Actors = tuple[Array, Array]
FRACTIONS = (1.0, 0.5, 0.25, 0.1)


@dataclass(frozen=True)
class Safeguard:
    """Accept or refuse new actor weights by their predicted cost.

    Attributes
    ----------
    predicted_cost : J(ζ; Ŵ_a1, Ŵ_a2), infinite for a policy that loses the vehicle
    reference : (m,) weights to go back to
    linear_cost : J(ζ) of the linear H-infinity policy; infinite where that is not to be used
    """

    predicted_cost: Callable[[Array, Array, Array], float]
    reference: Array
    linear_cost: Callable[[Array], float] = lambda zeta: np.inf

    def certified(self, zeta: Array, actors: Actors) -> tuple[Actors, float, bool]:
        """Return the actors to go on from at ζ (n,), J of them, and whether they are the reference.

        They are when its J is lower.
        """
        cost = self.predicted_cost(zeta, *actors)
        restart = self.predicted_cost(zeta, self.reference, self.reference)
        if restart < cost:
            return (self.reference, self.reference), restart, True
        return actors, cost, False

    def accepted(
        self, zeta: Array, actors: Actors, proposed: Actors, cost: float
    ) -> tuple[Actors, float, float]:
        """Return the actors after the largest certified part of the way to `proposed`, it and their J.

        `cost`: J of the present actors at ζ (n,), which has to fall.
        """
        for fraction in FRACTIONS:
            tried = tuple(
                old + fraction * (new - old) for old, new in zip(actors, proposed, strict=True)
            )
            reached = self.predicted_cost(zeta, *tried)
            if reached < cost:
                return (tried[0], tried[1]), fraction, reached
        return actors, 0.0, cost
