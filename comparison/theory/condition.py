"""One assumption or condition of the paper, with its numbers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Condition:
    """One line of `check`.

    Attributes
    ----------
    name : what must hold
    paper : where the paper says so
    value, bound : the two sides; None if not known
    holds : None if it can't be decided
    note : what the numbers are, and what is missing
    """

    name: str
    paper: str
    value: float | None
    bound: float | None
    holds: bool | None
    note: str
