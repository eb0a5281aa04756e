"""Errors whose message is meant for the user: what was given, what is required, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class StationkeepError(Exception):
    """Base of every error that stationkeep raises on purpose."""


class InputError(StationkeepError, ValueError):
    """The input can't be used; the message is one sentence (exit code 2)."""


class RunError(StationkeepError, RuntimeError):
    """A computation failed on valid input; what it finished is kept (exit code 1)."""


class GammaTooSmallError(InputError):
    """The attenuation level gamma admits no solution of the game.

    Attributes
    ----------
    gamma : float
        The level that was given [-].
    threshold : float
        Infimum of the levels with R^-1 - gamma^-2 W_d^-1 > 0, sqrt(lambda_max(W_d^-1 R)) [-].
    gamma_star : float or None
        Infimum of the levels for which the linearised game has a stabilising solution, if known [-].
    """

    def __init__(self, gamma: float, threshold: float, gamma_star: float | None = None) -> None:
        self.gamma = gamma
        self.threshold = threshold
        self.gamma_star = gamma_star
        star = "" if gamma_star is None else f" (gamma* of the linearised game is {gamma_star:.6g})"
        if gamma <= threshold:
            reason = (
                "R^-1 - gamma^-2 W_d^-1 must be positive definite, that is "
                f"gamma > sqrt(lambda_max(W_d^-1 R)) = {threshold:.6g}{star}, because at a rest point "
                "of a neutrally buoyant vehicle the Hamilton-Jacobi-Isaacs equation has no solution "
                "otherwise"
            )
        else:
            reason = f"the game Riccati equation has no stabilising solution there{star}"
        super().__init__(f"gamma = {gamma:g} is too small: {reason}; increase gamma")


def is_told(times: int) -> bool:
    """Return whether a message that comes again and again is told this time: at 1, 10, 100, ..."""
    return str(times).rstrip("0") == "1"


def nearest(given: str, known: Iterable[str]) -> str:
    """Return a half-sentence that names the known word nearest to `given`."""
    words = {word.lower(): word for word in sorted(known)}
    close = difflib.get_close_matches(given.lower(), list(words), n=1, cutoff=0.5)
    return f"did you mean '{words[close[0]]}'?" if close else f"known are {', '.join(words.values())}"
