"""One closed-loop run of any system, recorded until its end."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from ...symbolic import InputError, Problem, RunError
from ...symbolic.arrays import Array
from ..learning import LearnerStep, Monitor
from .history import History
from .plant import PlantState
from .policy import LearnedPolicy, LearnerScenario, fixed_points
from .settings import RunSettings
from .turns import by_its_turn

Progress = Callable[[float], None]
P = TypeVar("P", contravariant=True)


class System(ABC, Generic[P]):
    """A plant behind its sensors and actuators, driven by policies of the kind P.

    Attributes
    ----------
    problem : the model that policies are made for
    settings : of the run
    history : what is recorded
    state : of the plant
    """

    problem: Problem
    settings: RunSettings
    history: History
    state: PlantState

    @abstractmethod
    def command(self, policy: P, period: float) -> Array:
        """Ask the policy, and return what the plant gets until it is asked again."""

    @abstractmethod
    def answer(self, policy: P | None) -> Array:
        """Return what the policy's disturbance player does meanwhile; nothing without a policy."""

    @abstractmethod
    def record(self, t: float, command: Array, answer: Array) -> None:
        """Record time, state, inputs and cost."""

    @abstractmethod
    def advance(self, t: float, command: Array, answer: Array, period: float) -> None:
        """Move the plant; raises RunError where that fails."""

    def outside(self) -> str | None:
        """Return why a run can't go on from the present state, or None."""
        zeta = self.state.zeta
        far = np.abs(zeta) / self.problem.scale
        if not math.isfinite(far.max()):
            return "the state is not finite"
        fault = self.left_domain(zeta)
        if fault is not None:
            return fault
        if far.max() > self.settings.chi:
            name, chi = self.problem.state_names[int(far.argmax())], self.settings.chi
            return f"the state left chi ({name} is {far.max():.2f} half-widths, over {chi:g})"
        return None

    def left_domain(self, zeta: Array) -> str | None:
        """Return how ζ (n,) is outside of the domain, or None."""
        fault = self.problem.outside(zeta)
        return None if fault is None else f"the state left the domain ({fault})"


def drive(
    system: System[P], policy: P, scenario: LearnerScenario | None, progress: Progress | None = None
) -> History:
    """Run a system in closed loop with a policy, and return what was recorded.

    Ends early, keeping what was recorded and naming the reason, when the state leaves the domain or χ,
    anything is not finite, or the user interrupts.

    Parameters
    ----------
    scenario : of the learner, if the policy has one
    progress : called with the simulated time [s] after every control period
    """
    loop = _Loop(system, policy, scenario)
    started, worked = time.perf_counter(), time.process_time()
    try:
        loop.go(progress)
    except KeyboardInterrupt:
        loop.history.stopped = f"interrupted at t = {loop.t:.2f} s"
    loop.finish()
    loop.history.wall_seconds = time.perf_counter() - started
    loop.history.processor_seconds = time.process_time() - worked
    return loop.history


class _Loop(Generic[P]):
    def __init__(self, system: System[P], policy: P, scenario: LearnerScenario | None) -> None:
        self.system, self.policy = system, policy
        self.history = system.history
        self.learned: LearnedPolicy | None = getattr(policy, "learned", None)
        self.monitor = None
        if self.learned is not None and scenario is not None:
            points = fixed_points(scenario.samples, scenario.setup())
            self.monitor = Monitor(self.learned.learner, points)
        self.t = self.next_look = 0.0

    def go(self, progress: Progress | None) -> None:
        system, period = self.system, self.system.settings.control_period
        n_steps = round(system.settings.duration / period)
        game = system.settings.mode == "game"
        answer = system.answer(None)
        for i in range(n_steps + 1):
            self.t = i * period
            system.state = by_its_turn(self.history, system.state, self.t)
            reason = system.outside()
            if reason:
                self.history.stopped = f"{reason} at t = {self.t:.2f} s"
                return
            try:
                command = system.command(self.policy, period)
            except (InputError, RunError, np.linalg.LinAlgError) as error:
                self.history.stopped = f"the controller failed at t = {self.t:.2f} s: {error}"
                return
            if game:
                answer = system.answer(self.policy)
            system.record(self.t, command, answer)
            if self.learned is not None and self.learned.last_step is not None:
                self._record_learner(self.learned.last_step)
            if i == n_steps:
                return
            try:
                system.advance(self.t, command, answer, period)
            except RunError as error:
                self.history.stopped = str(error)
                return
            if progress is not None:
                progress(self.t + period)

    def _record_learner(self, seen: LearnerStep, *, last: bool = False) -> None:
        history = self.history
        if self.monitor and (last or self.t >= self.next_look - 1e-9):
            self.next_look = self.t + self.system.settings.monitor_period
            history.looks.append(self.monitor.sample(self.t, seen))
        history.learn_time.append(self.t)
        history.bellman_error.append(seen.bellman_error)
        history.sample_error.append(seen.sample_error)
        history.projecting.append(seen.projecting)
        history.predicted_cost.append(seen.predicted_cost)
        history.accepted.append(seen.accepted)
        history.fallback.append(seen.fallback)
        history.linear.append(seen.linear)
        history.critic.append(seen.critic)
        history.actor_1.append(seen.actor_1)
        history.actor_2.append(seen.actor_2)

    def finish(self) -> None:
        """Record the weights that the run ended with."""
        learned = self.learned
        if learned is not None and learned.learn:
            self._record_learner(learned.learner.observe(learned.zeta), last=True)
            self.history.remembered = learned.learner.memory.weights
