"""The safeguard: actors move only as far as the model certifies, and never rest on worse than linear.

J(ζ; Ŵ_a1, Ŵ_a2) is the predicted cost of the game from the present state when both players follow
(14)(15). Before a step the actors restart from the reference weights (with the Riccati weights
u_1 = -R^-1 g(ζ)'P ζ) if J there is lower; then they go all, half, a quarter or a tenth of the way that
(20)(21) ask for, the first that lowers J, or stay. Until the next step the policy in use is the
actors', or, where that is predicted to cost less, the linear H-infinity policy u_1 = -K_1 ζ with the
constant gain K_1 = R^-1 g(0)'P. The actors learn on all the same. Where the model loses the vehicle
under them, that is where their J is infinite, the linear policy is in use too.

Along the model's own trajectory the cost already paid plus the J of the policy in use never rises: no
step raises the lesser J, and between steps the J of the one that is followed falls by exactly what is
paid. So with an exact model a run costs no more than either of the two from its initial state, up to
the horizon. (Policy improvement by rollout, and the best of several base policies at every state:
Bertsekas 2017, Dynamic Programming and Optimal Control I, 6.4.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ...symbolic.arrays import Array

Actors = tuple[Array, Array]
FRACTIONS = (1.0, 0.5, 0.25, 0.1)


class Certified(NamedTuple):
    """What a step goes on from.

    actors : each (m,); cost : J of them, NaN if nothing was predicted; restarted : whether they are the
    reference, which was predicted to cost less than the actors before
    """

    actors: Actors
    cost: float
    restarted: bool


class Accepted(NamedTuple):
    """What a step ends with.

    actors : each (m,); part : of the way to what was proposed; cost : J of them, NaN if nothing was
    predicted; linear : whether the linear H-infinity policy is predicted to cost less
    """

    actors: Actors
    part: float
    cost: float
    linear: bool


class Guard(Protocol):
    """Who decides how far the actors move."""

    def certified(self, zeta: Array, actors: Actors) -> Certified:
        """Return the actors to go on from at ζ (n,)."""
        ...

    def accepted(self, zeta: Array, start: Certified, proposed: Actors) -> Accepted:
        """Return the actors at ζ (n,) after a step from `start` to what the laws propose."""
        ...

    def kept(self, zeta: Array, start: Certified) -> Accepted:
        """Return the actors at ζ (n,) where none is taken."""
        ...


class Unguarded:
    """A guard that lets every step pass, and predicts nothing."""

    def certified(self, zeta: Array, actors: Actors) -> Certified:
        """Return the actors as they are."""
        return Certified(actors, np.nan, restarted=False)

    def accepted(self, zeta: Array, start: Certified, proposed: Actors) -> Accepted:
        """Return what is proposed."""
        return Accepted(proposed, 1.0, np.nan, linear=False)

    def kept(self, zeta: Array, start: Certified) -> Accepted:
        """Return the actors as they are."""
        return Accepted(start.actors, 0.0, np.nan, linear=False)


class Costs(Protocol):
    """Predicted costs from a state; `rows.Predictor` is one."""

    def cost(self, zeta: Array, actor_1: Array, actor_2: Array) -> float:
        """Return J(ζ; Ŵ_a1, Ŵ_a2), infinite for a policy that loses the vehicle."""
        ...

    def linear_cost(self, zeta: Array) -> float:
        """Return J(ζ) of the linear H-infinity policy."""
        ...


@dataclass(frozen=True)
class Safeguard:
    """Accept or refuse new actor weights by their predicted cost.

    Attributes
    ----------
    costs : predicted
    reference : (m,) weights to go back to
    may_use_linear : whether the linear H-infinity policy is known
    """

    costs: Costs
    reference: Array
    may_use_linear: bool = True

    def certified(self, zeta: Array, actors: Actors) -> Certified:
        """Return the actors to go on from at ζ (n,): the reference when its J is lower."""
        cost = self.costs.cost(zeta, *actors)
        restart = self.costs.cost(zeta, self.reference, self.reference)
        if restart < cost:
            return Certified((self.reference, self.reference), restart, restarted=True)
        return Certified(actors, cost, restarted=False)

    def accepted(self, zeta: Array, start: Certified, proposed: Actors) -> Accepted:
        """Return the actors after the largest certified part of the way to `proposed`.

        That is the first that lowers J at ζ (n,).
        """
        for part in FRACTIONS:
            control, disturbance = (
                old + part * (new - old) for old, new in zip(start.actors, proposed, strict=True)
            )
            reached = self.costs.cost(zeta, control, disturbance)
            if reached < start.cost:
                return Accepted((control, disturbance), part, reached, self._linear(zeta, reached))
        return self.kept(zeta, start)

    def kept(self, zeta: Array, start: Certified) -> Accepted:
        """Return the actors as they are, or the linear policy where it costs less at ζ (n,)."""
        return Accepted(start.actors, 0.0, start.cost, self._linear(zeta, start.cost))

    def _linear(self, zeta: Array, cost: float) -> bool:
        """Return whether the linear policy is predicted to cost less, or J is infinite."""
        return self.may_use_linear and (cost == np.inf or self.costs.linear_cost(zeta) < cost)
