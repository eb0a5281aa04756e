"""The vehicle and the cost of a scenario as a Gymnasium environment.

Needs `pip install 'stationkeep[gym]'`; nothing else imports this module.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...online import build_disturbance
from ...online.loop import PlantState
from ...online.vehicle import HeldPlant, MeasurementNoise
from ...symbolic import InputError, RunError
from ...symbolic.arrays import Array
from ..policies import LinearPolicy
from ..scenario import DEFAULT, Scenario

try:
    import gymnasium
    from gymnasium.spaces import Box
except ImportError:
    raise InputError(
        "Gymnasium is not installed; install it with pip install 'stationkeep[gym]'"
    ) from None

Single = NDArray[np.float32]


class StationKeepingEnv(gymnasium.Env[Single, Single]):
    """Bring a vehicle back to its station and hold it there, at the least cost.

    Observation: ζ / half-width of the envelope, with the scenario's measurement noise, clipped to twice
    χ, (12,) float32. Action: (n,) float32 in [-1, 1], held for a control period;

    - `thrusters`: the share of each thruster's limit in its direction (8 of them on a BlueROV2 Heavy);
    - `wrench`: body wrench beyond the trim as a share of `wrench_scale`, without limits of thrusters.

    Reward: -∫ ζ'Qζ + u_1'R u_1 over the period, u_1 = J^-T τ_b - u_trim; no second player acts, the
    disturbance is [simulation.disturbance]'s. An episode ends (terminated) where the pitch passes its
    limit or a state leaves χ, and is then charged for the rest of it with the state cost there, so that
    leaving is never cheaper than staying; it is truncated after `simulation.duration`.

    `info`: `zeta` (12,) unscaled and without noise, `time` [s], `cost` so far without that charge,
    `rest` = ζ'P ζ, which estimates the cost after the end, and `stopped`, why it was terminated.

    Parameters
    ----------
    scenario : vehicle, game, envelope and simulation, or its name
    actions : None takes thrusters where the vehicle's file has them

    Attributes
    ----------
    wrench_scale : (6,) the largest that the linear H-infinity policy asks for in the envelope, an axis
        each, level and without trim [N, N m]

    Examples
    --------
    >>> env = StationKeepingEnv("bluerov2-heavy")
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self,
        scenario: Scenario | str = DEFAULT,
        *,
        actions: Literal["thrusters", "wrench"] | None = None,
    ) -> None:
        self.scenario = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
        self.settings = self.scenario.simulation
        self.station = self.scenario.station_keeping()
        driven = self.scenario.plant_vehicle()
        source = build_disturbance(self.settings.disturbance)
        self._plant = HeldPlant(self.station, source, self.settings.tolerance, driven)
        thrusters = (driven or self.station.model.vehicle).thrusters
        if actions not in (None, "thrusters", "wrench"):
            raise InputError(f"actions is '{actions}', but must be 'thrusters' or 'wrench'")
        if actions == "thrusters" and thrusters is None:
            raise InputError("the vehicle has no thruster layout; choose actions='wrench'")
        self._thrusters = None if actions == "wrench" else thrusters
        gain = np.abs(LinearPolicy(self.station.problem).gain)
        self.wrench_scale = gain @ self.station.envelope
        n_actions = 6 if self._thrusters is None else self._thrusters.matrix.shape[1]
        self._edge = 2.0 * self.settings.chi
        self.observation_space = Box(-self._edge, self._edge, (12,), np.float32)
        self.action_space = Box(-1.0, 1.0, (n_actions,), np.float32)
        self._noise = MeasurementNoise(self.settings.noise)
        self._state, self._steps = PlantState(np.zeros(12), 0.0, 0.0), 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Single, dict[str, Any]]:
        """Start at envelope x U(-1, 1)^12 x U(inner, 1), or at `options["state"]`, ζ (12,).

        `inner` is that of [samples]. The attitude is taken the short way and is continuous from there
        on, until an angle gets farther than half a turn and an eighth. Raises InputError for what is no
        state.
        """
        super().reset(seed=seed)
        radius = self.np_random.uniform(self.scenario.samples.inner, 1.0)
        drawn = self.station.envelope * self.np_random.uniform(-1.0, 1.0, 12) * radius
        noise = {"seed": int(self.np_random.integers(2**31))}
        self._noise = MeasurementNoise(self.settings.noise.model_copy(update=noise))
        start = self.station.problem.initial_state((options or {}).get("state", drawn))
        self._state, self._steps = PlantState(start, 0.0, 0.0), 0
        return self._seen(), self._info("")

    def step(self, action: Single) -> tuple[Single, float, bool, bool, dict[str, Any]]:
        """Hold the action for a control period.

        Raises
        ------
        InputError
            If the action is not n finite numbers.
        """
        period = self.settings.control_period
        before, stopped = self._state, ""
        try:
            wrench = self._wrench(action)
            reached = self._plant.advance(self._time, before, wrench, np.zeros(6), period)
            short = self.station.problem.angles.reentered(reached.zeta)
            self._state = replace(reached, zeta=short)
            stopped = self._left()
        except RunError as error:
            stopped = str(error)
        self._steps += 1
        reward = before.cost - self._state.cost
        if stopped:
            left = max(self.settings.duration - self._time, 0.0)
            reward -= left * float(self._state.zeta @ self.station.game.Q @ self._state.zeta)
        truncated = not stopped and self._steps >= round(self.settings.duration / period)
        return self._seen(), reward, bool(stopped), truncated, self._info(stopped)

    @property
    def _time(self) -> float:
        return self._steps * self.settings.control_period

    def _wrench(self, action: Single) -> Array:
        """Return τ_b of an action."""
        share = np.asarray(action, dtype=np.float64)
        if share.shape != self.action_space.shape or not np.all(np.isfinite(share)):
            raise InputError(f"an action must be {self.action_space.shape[0]} finite numbers")
        share = np.clip(share, -1.0, 1.0)
        if self._thrusters is not None:
            reverse, forward = self._thrusters.limits
            return np.asarray(
                self._thrusters.matrix @ (np.where(share < 0.0, -reverse, forward) * share)
            )
        (J,) = self.station.model.kinematics(self._state.zeta[:6])
        return np.asarray(self.wrench_scale * share + J.T @ self.station.model.u_trim)

    def _left(self) -> str:
        """Return why the episode ends here, empty if it goes on."""
        zeta = self._state.zeta
        if abs(np.degrees(zeta[4])) > self.settings.pitch_limit:
            return "the pitch left its limit"
        far = np.abs(zeta) / self.station.half_widths
        return "the state left chi" if far.max() > self.settings.chi else ""

    def _seen(self) -> Single:
        scaled = self._noise.measure(self._state.zeta) / self.station.half_widths
        return np.clip(scaled, -self._edge, self._edge).astype(np.float32)

    def _info(self, stopped: str) -> dict[str, Any]:
        zeta = self._state.zeta
        rest = float(zeta @ self.station.problem.P @ zeta)
        cost = self._state.cost
        return {"zeta": zeta, "time": self._time, "cost": cost, "rest": rest, "stopped": stopped}
