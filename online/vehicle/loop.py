"""One closed-loop run: controller, plant and disturbance, recorded until its end."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from ...symbolic import InputError, RunError, StationKeeping, Vehicle
from ...symbolic.arrays import Array
from ...symbolic.underwater import STATE_NAMES
from ..learning import LearnerStep, Monitor
from .allocation import Allocator
from .controller import Controller, ControllerScenario, fixed_points
from .disturbance import DisturbanceSource, build_disturbance
from .history import History
from .noise import MeasurementNoise
from .observer import DisturbanceObserver
from .plant import HeldPlant, PlantState
from .settings import SimulationSettings

Progress = Callable[[float], None]


class RunScenario(ControllerScenario, Protocol):
    """What a run needs of a scenario."""

    @property
    def simulation(self) -> SimulationSettings:
        """Settings of the run."""
        ...

    def plant_vehicle(self) -> Vehicle | None:
        """Return the vehicle that is driven, or None for the one of `station_keeping`."""
        ...


class Policy(Protocol):
    """What drives the vehicle: a controller, or a baseline with the same steps."""

    u_disturbance: Array

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        """Return the body wrench to hold for dt, shape (6,)."""
        ...

    def body_wrench(self, u: Array) -> Array:
        """Return J'u at the last state, shape (6,)."""
        ...


def run(
    scenario: RunScenario,
    policy: Policy | None = None,
    progress: Progress | None = None,
    source: DisturbanceSource | None = None,
) -> History:
    """Run a scenario in closed loop, with its own controller unless a policy is given.

    Ends early, keeping what was recorded and naming the reason, when the pitch leaves its band, the
    state leaves χ, anything is not finite, or the user interrupts.

    Parameters
    ----------
    progress : called with the simulated time [s] after every control period
    source : the disturbance d(t); the one of the scenario's settings if None
    """
    if source is None:
        source = build_disturbance(scenario.simulation.disturbance)
    loop = _Loop(scenario, Controller(scenario) if policy is None else policy, source)
    started, worked = time.perf_counter(), time.process_time()
    try:
        loop.go(progress)
    except KeyboardInterrupt:
        loop.history.stopped = f"interrupted at t = {loop.t:.2f} s"
    loop.finish()
    loop.history.wall_seconds = time.perf_counter() - started
    loop.history.processor_seconds = time.process_time() - worked
    return loop.history


class _Loop:
    def __init__(self, scenario: RunScenario, policy: Policy, source: DisturbanceSource) -> None:
        self.settings = scenario.simulation
        self.station: StationKeeping = scenario.station_keeping()
        self.policy = policy
        self.monitor = None
        if isinstance(policy, Controller):
            self.monitor = Monitor(policy.learner, fixed_points(scenario.samples, self.station))
        vehicle = scenario.plant_vehicle()
        self.plant = HeldPlant(self.station, source, self.settings.tolerance, vehicle)
        limited = self.settings.thruster_limits
        self.thrusters = Allocator(vehicle or self.station.model.vehicle) if limited else None
        self.noise = MeasurementNoise(self.settings.noise)
        bandwidth = self.settings.observer_bandwidth
        self.observer = DisturbanceObserver(self.station, bandwidth) if bandwidth else None
        self.history = History()
        self.policy_seconds: list[float] = []
        self.state = PlantState(np.array(self.settings.initial_state), 0.0, 0.0)
        self.t = self.next_look = 0.0

    def go(self, progress: Progress | None) -> None:
        period = self.settings.control_period
        n_steps = round(self.settings.duration / period)
        tau_b, tau_d = np.zeros(6), np.zeros(6)
        for i in range(n_steps + 1):
            self.t = i * period
            reason = self._out_of_bounds()
            if reason:
                self.history.stopped = f"{reason} at t = {self.t:.2f} s"
                return
            try:
                tau_b = self._command(period)
            except (InputError, RunError, np.linalg.LinAlgError) as error:
                self.history.stopped = f"the controller failed at t = {self.t:.2f} s: {error}"
                return
            if self.settings.mode == "game":
                tau_d = self.policy.body_wrench(self.policy.u_disturbance)
            self._record(tau_b, tau_d)
            if i == n_steps:
                return
            try:
                self.state = self.plant.advance(self.t, self.state, tau_b, tau_d, period)
            except RunError as error:
                self.history.stopped = str(error)
                return
            if progress is not None:
                progress(self.t + period)

    def _command(self, period: float) -> Array:
        """Return what the vehicle gets of the policy's wrench: timed, compensated and allocated."""
        seen = self.noise.measure(self.state.zeta)
        started = time.perf_counter()
        tau_b = self.policy.step(seen[:6], seen[6:], period)
        self.policy_seconds.append(time.perf_counter() - started)
        if self.observer is not None:
            estimate = self.observer.step(seen, period)
            tau_b = tau_b - self.policy.body_wrench(estimate)
            self.history.estimate.append(estimate)
        if self.thrusters is not None:
            given = self.thrusters.allocate(tau_b)
            self.history.thrust.append(given.thrust)
            self.history.saturated.append(given.saturated)
            tau_b = given.wrench
        if self.observer is not None:
            self.observer.applied(tau_b)
        return tau_b

    def _out_of_bounds(self) -> str | None:
        zeta, settings = self.state.zeta, self.settings
        far = np.abs(zeta) / self.station.half_widths
        if not math.isfinite(far.max()):
            return "the state is not finite"
        pitch = math.degrees(zeta[4])
        if abs(pitch) > settings.pitch_limit:
            return f"the pitch left ±{settings.pitch_limit:g} deg ({pitch:.1f} deg)"
        if far.max() > settings.chi:
            name = STATE_NAMES[int(far.argmax())]
            return f"the state left chi ({name} is {far.max():.2f} half-widths, over {settings.chi:g})"
        return None

    def _record(self, tau_b: Array, tau_d: Array) -> None:
        history, state = self.history, self.state
        _, u_control, disturbance = self.plant.rates(self.t, state.zeta, tau_b, tau_d)
        history.time.append(self.t)
        history.zeta.append(state.zeta)
        history.tau_b.append(tau_b)
        history.u_control.append(u_control)
        history.disturbance.append(disturbance)
        history.cost.append(state.cost)
        history.attenuated.append(state.attenuated)
        if isinstance(self.policy, Controller) and self.policy.last_step is not None:
            self._record_learner(self.policy.last_step)

    def _record_learner(self, seen: LearnerStep, *, last: bool = False) -> None:
        history = self.history
        if self.monitor and (last or self.t >= self.next_look - 1e-9):
            self.next_look = self.t + self.settings.monitor_period
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
        """Record the weights that the run ended with, and the policy's time."""
        if self.policy_seconds:
            self.history.policy_median = float(np.median(self.policy_seconds))
            self.history.policy_mean = float(np.mean(self.policy_seconds))
        if isinstance(self.policy, Controller) and self.policy.learn:
            learner = self.policy.learner
            self._record_learner(learner.observe(self.policy.zeta), last=True)
            self.history.remembered = learner.memory.weights
