"""What a scenario says of the game, the envelope and the basis."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from ...symbolic.toml import Settings

Weight = list[float] | list[list[float]]


class GameSettings(Settings):
    """Weights of (5); a list is a diagonal. A vehicle needs Q, R and gamma; a problem brings its own.

    Attributes
    ----------
    Q : n or n x n; R : k or k x k
    W_d : k or k x k, the word "R" for W_d = R, or "I" for the paper's, the identity
    gamma : attenuation level [-]
    """

    Q: Weight | None = None
    R: Weight | None = None
    W_d: Weight | str = "I"
    gamma: Annotated[float, Field(gt=0.0, le=1e6)] | None = None

    @model_validator(mode="after")
    def _word(self) -> GameSettings:
        if isinstance(self.W_d, str) and self.W_d not in ("R", "I"):
            raise ValueError(
                f'W_d is \'{self.W_d}\', but must be a matrix, a diagonal, or the word "R" or "I"'
            )
        return self


class EnvelopeSettings(Settings):
    """Where the plant is expected: half-widths of the states, in their units.

    `scale` is the part of it in which samples are drawn and policies compared. A problem has
    half-widths of its own, which are taken where none are given.
    """

    half_widths: tuple[float, ...] | None = None
    scale: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0

    @model_validator(mode="after")
    def _positive(self) -> EnvelopeSettings:
        if self.half_widths is not None and min(self.half_widths, default=0.0) <= 0.0:
            raise ValueError(
                f"half_widths must be positive, but one is {min(self.half_widths, default=0.0)}"
            )
        return self


class BasisSettings(Settings):
    """The basis: `quadratic`, `drag`, `drag-cubic`, or a user's as "file.py:function"."""

    name: str = "drag"
