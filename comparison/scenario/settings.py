"""What a scenario says of the game, the envelope and the basis."""

from __future__ import annotations

from pydantic import Field, PositiveFloat, model_validator

from ...symbolic.toml import Settings

Weight = list[float] | list[list[float]]


class GameSettings(Settings):
    """Weights of (5); a list is a diagonal.

    Attributes
    ----------
    Q : 12 or 12x12; R : 6 or 6x6
    W_d : 6 or 6x6, or the word "R" for W_d = R; the paper's is the identity
    gamma : attenuation level [-]
    """

    Q: Weight
    R: Weight
    W_d: Weight | str = Field(default_factory=lambda: [1.0] * 6)
    gamma: PositiveFloat

    @model_validator(mode="after")
    def _word(self) -> GameSettings:
        if isinstance(self.W_d, str) and self.W_d != "R":
            raise ValueError(
                f"W_d is '{self.W_d}', but must be a matrix, a diagonal, or the word \"R\""
            )
        return self


class EnvelopeSettings(Settings):
    """Where the vehicle is expected: half-widths of the states [m, rad, m/s, rad/s].

    `scale` is the part of it in which samples are drawn and policies compared.
    """

    half_widths: tuple[float, ...] = Field(min_length=12, max_length=12)
    scale: PositiveFloat = 1.0

    @model_validator(mode="after")
    def _positive(self) -> EnvelopeSettings:
        if min(self.half_widths) <= 0.0:
            raise ValueError(f"half_widths must be positive, but one is {min(self.half_widths)}")
        return self


class BasisSettings(Settings):
    """The basis: `quadratic`, `drag`, `drag-cubic`, or a user's as "file.py:function"."""

    name: str = "drag"
