"""Control laws that learn nothing, and how the disturbance player answers them.

None of them has a disturbance player of its own. In `game` mode the disturbance answers every control
as it does at the saddle point,

    u_2 = -γ^-2 W_d^-1 R u_1,   so that   v = u_1 + u_2 = R_eff^-1 R u_1   and
    u_1'R u_1 - γ^2 u_2'W_d u_2 = v'R_eff v:

the cost of the run is that of the single-player equivalent under v, V* is the least there is, and the
regret is nonnegative and zero for the optimal u_1 alone. Against the worst disturbance the policy
costs at least as much, so that the regret is a lower bound of what it loses in the game. For the
linear H-infinity policy and for a predictive controller of the game this u_2 is their own. A law that
was designed for a plant on which nobody answers gets R_eff^-1 R of the force that it asks for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from ...symbolic import InputError, Problem
from ...symbolic.arrays import Array


class Feedback(ABC):
    """A control law u_1(ζ) of a problem.

    Attributes
    ----------
    problem : plant and game
    zeta : (n,) the last state
    u_control, u_disturbance : (k,) u_1 there, and the answer u_2
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        game = problem.game
        self._answer = -game.disturbance_inverse @ game.R if problem.same_inputs else None
        self.zeta = np.zeros(problem.n_states)
        self.u_control = np.zeros(problem.n_inputs)
        self.u_disturbance = np.zeros(len(game.W_d))

    def step(self, zeta: Array, dt: float) -> Array:
        """Return u_1 at ζ (n,) to hold for dt [s], shape (k,)."""
        self.zeta = zeta
        self.u_control = self.control(zeta, dt)
        if self._answer is not None:
            self.u_disturbance = self._answer @ self.u_control
        return self.u_control

    @abstractmethod
    def control(self, zeta: Array, dt: float) -> Array:
        """Return u_1 at ζ, shape (k,), to be held for dt [s]."""


class FunctionPolicy(Feedback):
    """A control law given as a function of the state.

    Parameters
    ----------
    function : returns u_1 (k,) at ζ (n,)
    """

    def __init__(self, problem: Problem, function: Callable[[Array], Array]) -> None:
        super().__init__(problem)
        self._function = function

    def control(self, zeta: Array, dt: float) -> Array:
        """Return the function's value; raises InputError if it is not k numbers."""
        given = self._function(zeta)
        try:
            u_control = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            u_control = np.zeros(0)
        k = self.problem.n_inputs
        if u_control.shape != (k,):
            raise InputError(
                f"the policy returned an input of shape {u_control.shape}, but the problem needs {k} "
                "numbers"
            )
        return u_control
