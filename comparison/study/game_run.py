"""A learner on any problem, without a vehicle: policies applied continuously, learning in steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...offline import Plant
from ...online import Learner, LearnerStep
from ...symbolic import RunError
from ...symbolic.arrays import Array
from ...symbolic.integration import integrate


@dataclass(frozen=True)
class GameRun:
    """What was run.

    Attributes
    ----------
    time : (T,) [s]
    zeta : (T, n)
    steps : (T,) what the learner saw, with the weights before each step
    """

    time: Array
    zeta: Array
    steps: list[LearnerStep]

    def errors(self, weights: Array) -> tuple[Array, Array, Array]:
        """Return W̃_c, W̃_a1 and W̃_a2 for ideal weights (m,), each (T, m)."""
        critic = np.array([step.critic for step in self.steps])
        actors = [np.array([(step.actor_1, step.actor_2)[i] for step in self.steps]) for i in (0, 1)]
        return weights - critic, weights - actors[0], weights - actors[1]


def game_run(
    learner: Learner, zeta0: Array, duration: float, dt: float, *, disturbed: bool = True
) -> GameRun:
    """Let a learner drive its problem's plant from ζ_0 (n,), learning every dt [s].

    `disturbed`: ζ_dot = f + g (û_1 + û_2), as the proof has it; else û_1 alone, with d = 0.

    Raises
    ------
    RunError
        If the plant leaves ten times the envelope or becomes too stiff.
    """
    plant, zeta = Plant(learner.problem), zeta0
    states, steps = [], []
    for _ in range(round(duration / dt) + 1):
        states.append(zeta)
        steps.append(learner.step(zeta, dt))
        zeta = advance(learner, plant, zeta, dt, disturbed=disturbed)
    return GameRun(dt * np.arange(len(states), dtype=float), np.array(states), steps)


def advance(learner: Learner, plant: Plant, zeta: Array, dt: float, *, disturbed: bool = True) -> Array:
    """Return ζ after dt under the learner's present policies, shape (n,); raises as `game_run`."""

    def rhs(t: float, state: Array) -> Array:
        u_control, u_disturbance = learner.policies(state)
        return plant.rate(state, u_control + u_disturbance if disturbed else u_control)

    span = np.array([0.0, dt])
    reached = integrate(
        rhs, zeta, span, rtol=1e-6, atol=1e-8, method="RK45", first_step=dt / 4, max_calls=5000
    )[-1]
    if not np.abs(reached / plant.problem.scale).max() <= 10.0:  # nor NaN
        raise RunError("the state left ten times the envelope")
    return np.asarray(reached)
