"""A policy of the user's own, from a Python file."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...online import FunctionPolicy, LearnedPolicy, Policy
from ...symbolic import InputError, Setup
from ...symbolic.arrays import Array
from ...symbolic.pyfile import called, find_callable
from ..scenario import named_in


class OwnPolicy:
    """A user's policy with steps: what it raises, or an input of another shape, is one sentence.

    Attributes
    ----------
    name : "file.py:make"
    policy : what it made
    """

    def __init__(self, name: str, policy: Policy, n_inputs: int) -> None:
        self.name, self.policy, self._n_inputs = name, policy, n_inputs

    @property
    def learned(self) -> LearnedPolicy | None:
        """The learner's policy inside, where there is one."""
        return getattr(self.policy, "learned", None)

    @property
    def u_control(self) -> Array:
        """u_1 at the last state, (k,)."""
        return self.policy.u_control

    @property
    def u_disturbance(self) -> Array:
        """u_2 at the last state, (k_2,)."""
        return self.policy.u_disturbance

    def step(self, zeta: Array, dt: float) -> Array:
        """Return u_1 at ζ (n,) to hold for dt [s], (k,); raises InputError unless it is k numbers."""
        u_control = called(self._step, self.name, zeta, dt)
        if u_control.shape != (self._n_inputs,):
            raise InputError(
                f"the policy '{self.name}' returned an input of shape {u_control.shape}, but the "
                f"problem needs {self._n_inputs} numbers"
            )
        return np.asarray(u_control)

    def _step(self, zeta: Array, dt: float) -> Array:
        return np.asarray(self.policy.step(zeta, dt), dtype=float)


def law_of(name: str) -> Callable[[Setup], Policy]:
    """Return what makes the policy of "file.py:make": of a function of the state, or of its steps.

    Raises
    ------
    InputError
        If the file can't be loaded or has no such function. The law raises it for what `make` raises,
        and where that returns neither of the two.
    """
    make = find_callable(named_in(None, name), "the policy")

    def law(setup: Setup) -> Policy:
        made = called(make, name, setup)
        if all(hasattr(made, part) for part in ("step", "u_control", "u_disturbance")):
            return OwnPolicy(name, made, setup.problem.n_inputs)
        if not callable(made):
            raise InputError(
                f"'{name}' returns a {type(made).__name__}, but must return a function of the state, "
                "or an object with step(zeta, dt), u_control and u_disturbance"
            )
        return FunctionPolicy(setup.problem, lambda zeta: called(made, name, zeta))

    return law
