"""Settings of the closed loop; the `[simulation]` group of a scenario."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, model_validator

from ...symbolic.toml import Settings
from ...symbolic.value import BOUND

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
ZERO_SIX: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


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
    seed: NonNegativeInt = 1


class NoiseSettings(Settings):
    """Standard deviations of the white noise on what the policy sees at each control step.

    Attributes
    ----------
    position, attitude : of η [m], [rad]
    velocity, rate : of η_dot [m/s], [rad/s]
    seed : of the noise
    """

    position: NonNegativeFloat = 0.0
    attitude: NonNegativeFloat = 0.0
    velocity: NonNegativeFloat = 0.0
    rate: NonNegativeFloat = 0.0
    seed: NonNegativeInt = 1


class SimulationSettings(Settings):
    """One closed-loop run.

    Attributes
    ----------
    initial_state : (12,) x, y, z, φ, θ, ψ and their rates [m, rad, m/s, rad/s]
    duration : [s]
    mode : `game` drives the plant with û_1 + û_2, as the proof does; `disturbed` with û_1 and d(t)
    control_period : zero-order hold of the controller [s]
    tolerance : relative tolerance of the plant's integration
    pitch_limit : the run ends when |pitch| exceeds it [deg]
    chi : the run ends, the vehicle lost, when a state exceeds this multiple of the full envelope's
        half-width; the default is where predictions end too, and a quarter more than the optimum needs
        from the envelope's corners (docs/robustness.md)
    monitor_period : least time between two looks of the monitor [s]
    seed : of the envelope states that `compare` adds
    plant : the vehicle that is driven, a shipped name or the path of a TOML file; the scenario's own,
        which the controller is made for, when not given
    plant_parameters : parameters of the driven vehicle that differ from its file's
    thruster_limits : whether the plant gets what its thrusters can give instead of what is asked for
    noise : on what the policy sees
    observer_bandwidth : of a `DisturbanceObserver` whose estimate is fed forward [1/s]; 0 is none. For
        `disturbed` mode: in `game` mode it would cancel what the disturbance player does
    """

    initial_state: tuple[float, ...] = Field(min_length=12, max_length=12)
    duration: PositiveFloat = 60.0
    mode: Literal["game", "disturbed"] = "game"
    control_period: PositiveFloat = 0.02
    tolerance: Annotated[float, Field(gt=0.0, lt=1e-2)] = 1e-8
    pitch_limit: Annotated[float, Field(gt=0.0, lt=90.0)] = 75.0
    chi: PositiveFloat = BOUND
    monitor_period: PositiveFloat = 1.0
    seed: NonNegativeInt = 1
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
        return self
