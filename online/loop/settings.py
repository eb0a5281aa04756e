"""Settings of a closed-loop run of any problem."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, model_validator

from ...symbolic.toml import Seed, Settings
from ...symbolic.value import BOUND

MOST_STEPS = 1e7  # of a run: more than two days at 50 Hz


class RunSettings(Settings):
    """One closed-loop run.

    Attributes
    ----------
    initial_state : (n,) ζ(0); half of the envelope's half-widths when not given
    duration : [s]
    mode : `game` drives the plant with û_1 + û_2, as the proof does; `disturbed` with û_1 and d(t)
    control_period : zero-order hold of the controller [s]
    tolerance : relative tolerance of the plant's integration
    chi : the run ends, the plant lost, when a state exceeds this multiple of the full envelope's
        half-width; the default is where predictions end too, and a quarter more than the optimum needs
        from the envelope's corners (docs/theory/disturbances.md)
    monitor_period : least time between two looks of the monitor [s]
    seed : of the envelope states that `compare` adds
    """

    initial_state: tuple[float, ...] | None = None
    duration: Annotated[float, Field(gt=0.0, le=1e6)] = 60.0
    mode: Literal["game", "disturbed"] = "game"
    control_period: Annotated[float, Field(ge=1e-5, le=1e4)] = 0.02
    tolerance: Annotated[float, Field(gt=0.0, lt=1e-2)] = 1e-8
    chi: Annotated[float, Field(gt=0.0, le=1e6)] = BOUND
    monitor_period: PositiveFloat = 1.0
    seed: Seed = 1

    @model_validator(mode="after")
    def _countable(self) -> RunSettings:
        steps = self.duration / self.control_period
        if not 0.5 <= steps <= MOST_STEPS:
            raise ValueError(
                f"duration is {self.duration:g} s and control_period {self.control_period:g} s, which "
                f"makes {steps:.3g} control steps; choose them for 1 to {MOST_STEPS:g}"
            )
        return self
