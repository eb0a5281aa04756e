"""The station-keeping game of one vehicle, with everything that learner and solvers share."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

from casadi import SX

from ..arrays import Array
from ..compiled import c_source, dense_function
from ..game import Game, Problem
from ..value import Basis, ValueFunctions
from .model import Model


@dataclass(frozen=True, eq=False)
class StationKeeping:
    """A vehicle, a game and a basis, compiled when first used.

    Attributes
    ----------
    model : the vehicle's dynamics
    problem : the game on its plant
    basis : of the value function
    half_widths : (12,) of the full envelope [m, rad, m/s, rad/s], the unit of the scaled state
    envelope : (12,) half-widths of the part in which policies are learned and compared
    """

    model: Model
    problem: Problem
    basis: Basis
    half_widths: Array
    envelope: Array

    @property
    def game(self) -> Game:
        """The weights of the game."""
        return self.problem.game

    @cached_property
    def functions(self) -> ValueFunctions:
        """Compiled basis, sample kernel and policies."""
        return ValueFunctions(self.problem, self.basis, compiled=self.model.compiled)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the generated code of f, g and σ: what every compiled function comes from."""
        return self._hash(sigma=self.basis.sigma)

    @cached_property
    def plant_fingerprint(self) -> str:
        """SHA-256 of the generated code of f and g: what an optimum comes from, whatever the basis."""
        return self._hash()

    def _hash(self, **more: SX) -> str:
        expressions = {"f": self.problem.drift, "g": self.problem.input_matrix, **more}
        function = dense_function("fingerprint", {"zeta": self.problem.zeta}, expressions)
        return hashlib.sha256(c_source(function).encode()).hexdigest()

    @cached_property
    def riccati_weights(self) -> Array:
        """Weights with W'σ(ζ) = ζ'P ζ, shape (m,): the linear H-infinity policy."""
        return self.basis.quadratic_weights(self.problem.P)
