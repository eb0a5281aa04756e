"""Control laws of one's own, of any problem: a function of the state, and an object with a memory.

`stationkeep compare SCENARIO --policy examples/own_policy.py:make` puts one beside the others, and
`stationkeep sweep SCENARIO --policies learned,examples/own_policy.py:Integral` in a table.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from stationkeep import Scenario, simulate
from stationkeep.online import Feedback
from stationkeep.symbolic import Setup, two_state_game

Array = NDArray[np.float64]
problem = two_state_game()
PUSH = np.array([0.5])


def make(setup: Setup) -> Callable[[Array], Array]:
    """Return the linear policy cut at a quarter of what it asks for at the envelope."""
    K, _ = setup.problem.linear_gains
    most = 0.25 * np.abs(K) @ setup.envelope
    return lambda zeta: np.clip(-K @ zeta, -most, most)


class Integral(Feedback):
    """The linear policy with integral action: u_1 = -K ζ - ω ∫ K ζ dt.

    Any object with `step(zeta, dt)`, `u_control` and `u_disturbance` will do.
    """

    def __init__(self, setup: Setup, rate: float = 0.5) -> None:
        super().__init__(setup.problem)
        self.K, self.rate = setup.problem.linear_gains[0], rate
        self.stored = np.zeros(setup.problem.n_inputs)

    def control(self, zeta: Array, dt: float) -> Array:
        """Return u_1 at ζ to hold for dt [s]."""
        self.stored = self.stored - self.rate * self.K @ zeta * dt
        return -self.K @ zeta + self.stored


def main() -> list[Array]:
    """Return where each ends on the two-state game under a constant disturbance."""
    setup, ends = Scenario.load(f"{__file__}:problem").setup(), []
    for policy in (make(setup), Integral(setup)):
        run = simulate(
            problem, policy, [1.0, 0.0], 40.0, mode="disturbed", disturbance=lambda t, zeta: PUSH
        )
        ends.append(run["zeta"].values[-1])
    print("without a memory it ends at {}, with one at {}".format(*ends))
    return ends


if __name__ == "__main__":
    main()
