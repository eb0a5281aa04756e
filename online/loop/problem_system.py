"""The plant of any problem in closed loop."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ...symbolic import InputError, Problem
from ...symbolic.arrays import Array
from .history import History
from .loop import System
from .plant import PlantState, ProblemPlant
from .policy import Policy
from .settings import RunSettings

Disturbance = Callable[[float, Array], Array]


class ProblemSystem(System[Policy]):
    """A problem's own plant: what the policy asks for is what the plant gets.

    Parameters
    ----------
    problem : plant and game
    settings : of the run
    disturbance : d(t, ζ) (k_2,) of `disturbed` mode, held over a control period; nothing if None

    Raises
    ------
    InputError
        If the initial state is not one of the problem, or a disturbance meets `game` mode.
    """

    def __init__(
        self,
        problem: Problem,
        settings: RunSettings,
        disturbance: Disturbance | None = None,
        *,
        compiled: bool = True,
    ) -> None:
        if settings.initial_state is None:
            raise InputError(f"{problem.name}: a run needs an initial state; give one")
        if disturbance is not None and settings.mode == "game":
            raise InputError(
                f"{problem.name}: a disturbance is given, but in mode 'game' the second player is the "
                'disturbance; leave it out or choose mode = "disturbed"'
            )
        self.problem, self.settings = problem, settings
        self.history = History(problem)
        self.state = PlantState(problem.initial_state(settings.initial_state), 0.0, 0.0)
        self._disturbance = disturbance
        self._plant = ProblemPlant(problem, settings.tolerance, compiled=compiled)
        self._still = np.zeros(len(problem.game.W_d))

    def command(self, policy: Policy, period: float) -> Array:
        """Return the policy's u_1, (k,)."""
        started = time.perf_counter()
        u_control = np.asarray(policy.step(self.state.zeta, period), dtype=float)
        self.history.policy_seconds.append(time.perf_counter() - started)
        return u_control

    def answer(self, policy: Policy | None) -> Array:
        """Return the policy's u_2, (k_2,)."""
        return self._still if policy is None else policy.u_disturbance

    def record(self, t: float, command: Array, answer: Array) -> None:
        """Record time, state, inputs and cost."""
        history, state = self.history, self.state
        history.time.append(t)
        history.zeta.append(state.zeta)
        history.u_control.append(command)
        history.disturbance.append(self._acting(t, answer))
        history.cost.append(state.cost)
        history.attenuated.append(state.attenuated)

    def advance(self, t: float, command: Array, answer: Array, period: float) -> None:
        """Move the plant over a control period."""
        self.state = self._plant.advance(t, self.state, command, self._acting(t, answer), period)

    def _acting(self, t: float, answer: Array) -> Array:
        """Return what disturbs the plant from t on: the player's answer, or d(t, ζ)."""
        if self._disturbance is None:
            return answer
        return np.asarray(self._disturbance(t, self.state.zeta), dtype=float)
