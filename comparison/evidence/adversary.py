"""What the worst disturbance makes of a policy, by solving for it and by playing it in the closed loop.

The worst case of a policy with fixed weights is found by `offline.WorstCaseSolver` or
`offline.ScheduledWorstCase`. The learner is not such a policy: what it does later depends on what it
met before. It is searched in rounds. A run leaves a schedule of weights; the worst disturbance against
that schedule is played, as a force d(t), against the learner itself, which goes on learning and leaves
another schedule; and so on. Every cost that was played is a lower bound of the worst case of the
learner, and the largest is what is reported. Where the rounds settle, the disturbance is the worst
there is against the very weights that it provokes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...offline import Trajectory, WeightSchedule
from ...online import Controller, Feedback, History, VehiclePolicy, run
from ...online.vehicle import Disturbance
from ...symbolic import StationKeeping
from ...symbolic.arrays import Array
from ..scenario import Scenario


class PlayedForce:
    """The input of a trajectory as an earth-frame force d(t), zero after its end.

    On each interval of the mesh it is the polynomial through the collocation points.
    """

    steady = False

    def __init__(self, path: Trajectory) -> None:
        self.breaks: tuple[float, ...] = tuple(path.mesh[1:].tolist())
        self._mesh = path.mesh
        d, k = path.degree, path.v.shape[1]
        powers = np.vander(path.rule.nodes, d, increasing=True)
        self._coefficients = np.linalg.solve(powers, path.v.reshape(-1, d, k))
        self._exponents = np.arange(d)

    def at(self, t: float, position: Array) -> Disturbance:
        """Return the force at time t."""
        force = np.zeros(6)
        if t <= self._mesh[-1]:
            i = min(int(np.searchsorted(self._mesh, t, side="right")), len(self._mesh) - 1) - 1
            within = (t - self._mesh[i]) / (self._mesh[i + 1] - self._mesh[i])
            force = within**self._exponents @ self._coefficients[i]
        return Disturbance(force, np.zeros(3), np.zeros(3))


class FrozenPolicy(Feedback):
    """û_1 of (14) with weights (m,) that stay, and no safeguard."""

    def __init__(self, station: StationKeeping, weights: Array) -> None:
        super().__init__(station.problem)
        self.station = station
        self.weights = weights

    def control(self, zeta: Array, dt: float) -> Array:
        """Return -1/2 R^-1 g'σ'W."""
        u_control, _ = self.station.functions.policies(zeta, self.weights, self.weights)
        return np.array(u_control)


class WatchedController(Controller):
    """A controller that keeps the schedule of the actor weights it drives with."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._clock = 0.0
        self._times: list[float] = []
        self._weights: list[Array] = []

    def step(self, eta: Array, eta_dot: Array, dt: float) -> Array:  # type: ignore[override]
        """Return the body wrench to hold for dt, as a controller does."""
        wrench = super().step(eta, eta_dot, dt)
        if self.last_step is not None:
            self._times.append(self._clock)
            self._weights.append(self.learner.actor_1.copy())
        self._clock += dt
        return wrench

    @property
    def schedule(self) -> WeightSchedule:
        """The weights of û_1 so far."""
        return WeightSchedule(np.array(self._times), np.array(self._weights))


@dataclass(frozen=True)
class Played:
    """A run of a disturbance against a policy.

    Attributes
    ----------
    cost : ∫ ζ'Qζ + u_1'R u_1 - γ^2 d'W_d d dt + ζ(T)'P ζ(T), of what the vehicle did; None if the run
        ended early
    stopped : why it did, or None
    schedule : the weights that the learner drove with; None for another policy
    """

    cost: float | None
    stopped: str | None
    schedule: WeightSchedule | None = None


def play(scenario: Scenario, policy: VehiclePolicy, path: Trajectory | None) -> Played:
    """Run a policy against the input of a path, or without one in the scenario's mode.

    The loop is the real one: wrenches held over the control period, a learner that learns on.
    """
    if path is None:
        return _outcome(scenario, policy, run(scenario, policy))
    disturbed = scenario.with_settings(simulation={"mode": "disturbed"})
    return _outcome(scenario, policy, run(disturbed, policy, source=PlayedForce(path)))


def settled_weights(scenario: Scenario, zeta: Array, steps: int = 40) -> Array:
    """Return the actor weights after so many learning steps while the vehicle waits at ζ, (m,)."""
    controller = Controller(scenario)
    for _ in range(steps):
        controller.learner.step(zeta, controller.learned.period)
    return controller.learner.actor_1


def _outcome(scenario: Scenario, policy: VehiclePolicy, history: History) -> Played:
    schedule = policy.schedule if isinstance(policy, WatchedController) else None
    if history.stopped:
        return Played(None, history.stopped, schedule)
    end, P = history.zeta[-1], scenario.station_keeping().problem.P
    cost = history.cost[-1] - history.attenuated[-1] + float(end @ P @ end)
    return Played(cost, None, schedule)
