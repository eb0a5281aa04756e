"""Settings of the closed loop; the `[simulation]` group of a scenario."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from ...symbolic.toml import Seed, Settings
from ..loop import RunSettings

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
Deviation = Annotated[float, Field(ge=0.0, le=1e6)]
ZERO_SIX: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
USED: dict[str, set[str]] = {  # by each kind of disturbance
    "none": set(),
    "constant": {"force", "start"},
    "sinusoid": {"force", "frequency", "start"},
    "current": {"velocity", "start"},
    "waves": {"wave_height", "wave_period", "wave_heading", "depth", "peak_enhancement", "seed"},
}


class DisturbanceSettings(Settings):
    """A disturbance d(t), unknown to the controller.

    Attributes
    ----------
    kind : `none`, `constant` or `sinusoid` force, `current` step, `waves` (JONSWAP)
    force : earth-frame force and moment, or its amplitude [N, N m]
    frequency : of the sinusoid [Hz]
    velocity : earth-frame water velocity of the current [m/s]
    start : time of the step [s]
    wave_height : significant wave height H_s [m]
    wave_period : peak period T_p [s]
    wave_heading : direction of travel from the earth x axis [deg]
    depth : of the station below the surface [m]
    peak_enhancement : JONSWAP γ [-]
    seed : of the wave phases
    """

    kind: Literal["none", "constant", "sinusoid", "current", "waves"] = "none"
    force: Six = ZERO_SIX
    frequency: PositiveFloat = 0.1
    velocity: Three = (0.0, 0.0, 0.0)
    start: NonNegativeFloat = 0.0
    wave_height: PositiveFloat = 0.25
    wave_period: PositiveFloat = 4.0
    wave_heading: float = 0.0
    depth: PositiveFloat = 3.0
    peak_enhancement: Annotated[float, Field(ge=1.0)] = 3.3
    seed: Seed = 1

    def unused(self) -> dict[str, set[str]]:
        """Return, for the key that chooses among disturbances, the keys that the choice doesn't use."""
        return {"kind": set(type(self).model_fields) - {"kind"} - USED[self.kind]}


class NoiseSettings(Settings):
    """Standard deviations of the white noise on what the policy sees at each control step.

    Attributes
    ----------
    position, attitude : of η [m], [rad]
    velocity, rate : of η_dot [m/s], [rad/s]
    seed : of the noise
    """

    position: Deviation = 0.0
    attitude: Deviation = 0.0
    velocity: Deviation = 0.0
    rate: Deviation = 0.0
    seed: Seed = 1


class SimulationSettings(RunSettings):
    """One closed-loop run; what only a vehicle has is refused for another problem.

    Attributes
    ----------
    pitch_limit : the run ends when |pitch| exceeds it [deg]
    plant : the vehicle that is driven, a shipped name or the path of a TOML file; the scenario's own,
        which the controller is made for, when not given
    plant_parameters : parameters of the driven vehicle that differ from its file's
    thruster_limits : whether the plant gets what its thrusters can give instead of what is asked for
    noise : on what the policy sees
    observer_bandwidth : of a `DisturbanceObserver` whose estimate is fed forward [1/s]; 0 is none. For
        `disturbed` mode: in `game` mode it would cancel what the disturbance player does
    disturbance : d(t) of `disturbed` mode
    """

    pitch_limit: Annotated[float, Field(gt=0.0, lt=90.0)] = 75.0
    plant: str | None = None
    plant_parameters: dict[str, Any] = Field(default_factory=dict)
    thruster_limits: bool = False
    noise: NoiseSettings = NoiseSettings()
    observer_bandwidth: NonNegativeFloat = 0.0
    disturbance: DisturbanceSettings = DisturbanceSettings()

    @model_validator(mode="after")
    def _observed(self) -> SimulationSettings:
        if self.observer_bandwidth > 0.0 and self.mode == "game":
            raise ValueError(
                f"observer_bandwidth is {self.observer_bandwidth:g} and mode is 'game', but there an "
                'observer would cancel what the disturbance player does; choose mode = "disturbed"'
            )
        if self.disturbance.kind != "none" and self.mode == "game":
            raise ValueError(
                f"disturbance.kind is '{self.disturbance.kind}' and mode is 'game', where the "
                'disturbance is the second player\'s; choose mode = "disturbed", or leave it out'
            )
        return self
