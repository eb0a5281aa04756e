"""A critic law of the user's own, from a Python file."""

from __future__ import annotations

import numpy as np

from ...online.laws import Critic, Equations
from ...symbolic import InputError, Setup
from ...symbolic.arrays import Array
from ...symbolic.pyfile import called, find_callable


class OwnCritic:
    """A user's critic law: what it raises, or a result of another shape, is told in one sentence.

    Attributes
    ----------
    name : "file.py:make"
    law : what it made
    """

    def __init__(self, name: str, law: Critic) -> None:
        self.name, self.law = name, law

    def step(self, critic: Array, rows: Equations, dt: float) -> Array:
        """Return the law's Ŵ_c after dt [s], shape (m,); raises InputError unless it is m numbers."""
        reached = called(self._step, self.name, critic, rows, dt)
        if reached.shape != critic.shape:
            raise InputError(
                f"the critic law '{self.name}' returned weights of shape {reached.shape}, but the "
                f"basis has {len(critic)} functions"
            )
        return np.asarray(reached)

    def _step(self, critic: Array, rows: Equations, dt: float) -> Array:
        return np.asarray(self.law.step(critic, rows, dt), dtype=float)


def made_law(name: str, setup: Setup) -> Critic:
    """Return the critic law that make(setup) of "file.py:make" returns.

    Raises
    ------
    InputError
        If it can't be found or made, or has no step.
    """
    law = called(find_callable(name, "the critic law"), name, setup)
    if not callable(getattr(law, "step", None)):
        raise InputError(
            f"'{name}' returns a {type(law).__name__}, but must return an object with "
            "step(critic, rows, dt)"
        )
    return OwnCritic(name, law)
