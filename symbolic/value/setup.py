"""A problem, the basis of its value, and where it is learned: what learner and solvers share."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from casadi import SX

from ..arrays import Array
from ..compiled import Export, c_source, dense_function
from ..game import Game, Problem
from .basis import Basis
from .functions import ValueFunctions


@dataclass(frozen=True, eq=False, kw_only=True)
class Setup:
    """A problem and a basis, compiled when first used.

    Attributes
    ----------
    problem : the game on its plant
    basis : of the value function
    envelope : (n,) half-widths of the part of `half_widths` in which policies are learned and compared
    compiled : False uses CasADi's virtual machine even where a C compiler exists
    """

    problem: Problem
    basis: Basis
    envelope: Array
    compiled: bool = True

    @property
    def game(self) -> Game:
        """The weights of the game."""
        return self.problem.game

    @property
    def half_widths(self) -> Array:
        """Half-widths of the full envelope, (n,), the unit of the scaled state."""
        return self.problem.scale

    @cached_property
    def functions(self) -> ValueFunctions:
        """Compiled basis, sample kernel and policies."""
        return ValueFunctions(self.problem, self.basis, compiled=self.compiled)

    def exports(self, n_samples: int) -> Iterator[Export]:
        """Build every compiled function and yield what became of it, for so many sample points."""
        yield from self.functions.exports(n_samples)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the generated code of f, g and σ: what every compiled function comes from."""
        return self._hash(sigma=self.basis.sigma)

    @cached_property
    def plant_fingerprint(self) -> str:
        """SHA-256 of the generated code of f and g: what an optimum comes from, whatever the basis."""
        return self._hash()

    def _hash(self, **more: SX) -> str:
        problem = self.problem
        expressions = {"f": problem.drift, "g": problem.control_matrix, **more}
        if not problem.same_inputs:
            expressions["g_2"] = problem.disturbance_matrix
        function = dense_function("fingerprint", {"zeta": problem.zeta}, expressions)
        return hashlib.sha256(c_source(function).encode()).hexdigest()

    @cached_property
    def riccati_weights(self) -> Array:
        """Weights with W'σ(ζ) = ζ'P ζ, shape (m,): the linear H-infinity policy."""
        return self.basis.quadratic_weights(self.problem.P)
