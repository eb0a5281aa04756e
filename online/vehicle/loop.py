"""One closed-loop run of a vehicle: controller, plant and disturbance."""

from __future__ import annotations

import math
import time
from typing import Protocol

import numpy as np

from ...symbolic import StationKeeping, Vehicle
from ...symbolic.arrays import Array
from ..loop import LearnerScenario, PlantState, Progress, System, drive
from .allocation import Allocator
from .controller import Controller, ControllerScenario
from .disturbance import DisturbanceSource, build_disturbance
from .history import VehicleHistory
from .measurement import Limits
from .noise import MeasurementNoise
from .observer import DisturbanceObserver
from .plant import HeldPlant
from .settings import SimulationSettings


class RunScenario(ControllerScenario, LearnerScenario, Protocol):
    """What a run needs of a scenario."""

    @property
    def initial_state(self) -> Array:
        """ζ(0), (12,)."""
        ...

    def plant_vehicle(self) -> Vehicle | None:
        """Return the vehicle that is driven, or None for the one of `station_keeping`."""
        ...


class VehiclePolicy(Protocol):
    """What drives a vehicle: a controller, or a baseline with the same steps."""

    @property
    def u_disturbance(self) -> Array:
        """u_2 at the last state, (6,)."""
        ...

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:
        """Return the body wrench to hold for dt, shape (6,)."""
        ...

    def body_wrench(self, u: Array) -> Array:
        """Return J'u at the last state, shape (6,)."""
        ...


def run(
    scenario: RunScenario,
    policy: VehiclePolicy | None = None,
    progress: Progress | None = None,
    source: DisturbanceSource | None = None,
) -> VehicleHistory:
    """Run a vehicle's scenario in closed loop, with its own controller unless a policy is given.

    Ends early, keeping what was recorded and naming the reason, when the pitch leaves its band, the
    state leaves χ, anything is not finite, or the user interrupts.

    Parameters
    ----------
    progress : called with the simulated time [s] after every control period
    source : the disturbance d(t); the one of the scenario's settings if None
    """
    if source is None:
        source = build_disturbance(scenario.simulation.disturbance)
    system = VehicleSystem(scenario, source)
    policy = Controller(scenario) if policy is None else policy
    drive(system, policy, scenario, progress)
    return system.history


class VehicleSystem(System[VehiclePolicy]):
    """A vehicle behind its sensors, its observer and its thrusters."""

    history: VehicleHistory

    def __init__(self, scenario: RunScenario, source: DisturbanceSource) -> None:
        settings = scenario.simulation
        station: StationKeeping = scenario.station_keeping()
        self.settings: SimulationSettings = settings
        self.problem = station.problem
        self.history = VehicleHistory(station.problem)
        vehicle = scenario.plant_vehicle()
        self.plant = HeldPlant(station, source, settings.tolerance, vehicle)
        limited = settings.thruster_limits
        self.thrusters = Allocator(vehicle or station.model.vehicle) if limited else None
        self.noise = MeasurementNoise(settings.noise)
        self.observer = _observer(station, settings)
        self.state = PlantState(scenario.initial_state, 0.0, 0.0)

    def command(self, policy: VehiclePolicy, period: float) -> Array:
        """Return what the vehicle gets of the policy's wrench: timed, compensated and allocated."""
        seen = self.noise.measure(self.state.zeta)
        started = time.perf_counter()
        tau_b = policy.step(seen[:6], seen[6:], period)
        self.history.policy_seconds.append(time.perf_counter() - started)
        if self.observer is not None:
            estimate = self.observer.step(seen, period)
            tau_b = tau_b - policy.body_wrench(estimate)
            self.history.estimate.append(estimate)
        if self.thrusters is not None:
            given = self.thrusters.allocate(tau_b)
            self.history.thrust.append(given.thrust)
            self.history.saturated.append(given.saturated)
            tau_b = given.wrench
        if self.observer is not None:
            self.observer.applied(tau_b)
        return tau_b

    def answer(self, policy: VehiclePolicy | None) -> Array:
        """Return the body wrench of the policy's u_2, (6,)."""
        return np.zeros(6) if policy is None else policy.body_wrench(policy.u_disturbance)

    def record(self, t: float, command: Array, answer: Array) -> None:
        """Record time, state, wrench, inputs and cost."""
        history, state = self.history, self.state
        _, u_control, disturbance = self.plant.rates(t, state.zeta, command, answer)
        history.time.append(t)
        history.zeta.append(state.zeta)
        history.tau_b.append(command)
        history.u_control.append(u_control)
        history.disturbance.append(disturbance)
        history.cost.append(state.cost)
        history.attenuated.append(state.attenuated)

    def advance(self, t: float, command: Array, answer: Array, period: float) -> None:
        """Move the vehicle over a control period."""
        self.state = self.plant.advance(t, self.state, command, answer, period)

    def left_domain(self, zeta: Array) -> str | None:
        """Return how the pitch is beyond its limit, or None."""
        pitch, limit = math.degrees(zeta[4]), self.settings.pitch_limit
        return f"the pitch left ±{limit:g} deg ({pitch:.1f} deg)" if abs(pitch) > limit else None


def _observer(station: StationKeeping, settings: SimulationSettings) -> DisturbanceObserver | None:
    bandwidth = settings.observer_bandwidth
    if not bandwidth:
        return None
    limits = Limits.of(station, settings.chi, settings.pitch_limit)
    return DisturbanceObserver(station, bandwidth, limits=limits)
