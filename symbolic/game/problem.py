"""A game on a plant: what the learner and the offline solvers need to know, and nothing more."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array
from ..errors import GammaTooSmallError, InputError
from . import riccati
from .angles import Angles, Equivalence
from .checks import InverseDynamics, require_inverse, require_periodic
from .domain import Bound, margins_and_shown, outside, require_numbers
from .game import Game


@dataclass(frozen=True, eq=False)
class Problem:
    """ζ_dot = f(ζ) + g_1(ζ) u_1 + g_2(ζ) u_2 with f(0) = 0, and the game played on it.

    Attributes
    ----------
    name : appears in messages and files
    zeta : (n,) symbol
    drift : (n,) expression f of `zeta`, the steady trim already taken out
    control_matrix : (n, k) expression g_1 of `zeta`
    game : the weights
    scale : (n,) half-widths of the envelope, the unit of the scaled state x = ζ / scale
    disturbance_matrix : (n, k_2) expression g_2 of `zeta`; g_1 itself, as in the paper, if left out
    state_names, state_units : of the n states; x1 ... and 1 if left out
    input_names, input_units : of the k inputs; u1 ... and 1 if left out
    domain : bounds outside of which the equations have no meaning
    switching : (s,) expressions of `zeta`; f is only C^1 where one of them changes sign
    inverse_dynamics : for ζ = (η, η_dot) with as many inputs as η has entries; None if there is none
    periods : of the states that are angles, 0 for the others; no state is an angle if left out
    equivalence : a second way to write a state beside whole turns; None if there is none

    Raises
    ------
    InputError
        If the shapes disagree, f(0) is not 0, the scale is not positive, the origin is not in the
        domain, the inverse dynamics contradict f and g, or these have not the periods.
    """

    name: str
    zeta: SX
    drift: SX
    control_matrix: SX
    game: Game
    scale: Array
    disturbance_matrix: SX = None  # type: ignore[assignment]  # g_1 until it is known
    state_names: tuple[str, ...] = ()
    state_units: tuple[str, ...] = ()
    input_names: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    domain: tuple[Bound, ...] = ()
    switching: SX = field(default_factory=lambda: SX(0, 1))
    inverse_dynamics: InverseDynamics | None = None
    periods: tuple[float, ...] = ()
    equivalence: Equivalence | None = None

    def __post_init__(self) -> None:
        n, k = self.n_states, self.n_inputs
        if self.disturbance_matrix is None or _equal(self.disturbance_matrix, self.control_matrix):
            object.__setattr__(self, "disturbance_matrix", self.control_matrix)
        self._name("state", "x", n)
        self._name("input", "u", k)
        if self.drift.shape != (n, 1) or self.control_matrix.shape[0] != n:
            raise InputError(f"{self.name}: f must be ({n},) and g must have {n} rows")
        if self.disturbance_matrix.shape[0] != n:
            raise InputError(f"{self.name}: the disturbance matrix must have {n} rows")
        if self.game.Q.shape != (n, n) or self.game.R.shape != (k, k):
            raise InputError(
                f"{self.name}: Q has {len(self.game.Q)} rows and R has {len(self.game.R)}, but {n} "
                f"states and {k} inputs need {n} and {k}; give one weight for each"
            )
        if self.scale.shape != (n,) or not np.all(np.isfinite(self.scale) & (self.scale > 0.0)):
            raise InputError(f"{self.name}: the scale must be {n} positive half-widths")
        residual = float(np.abs(self._at_origin(self.drift)).max())
        if not residual < 1e-9:
            raise InputError(
                f"{self.name}: f(0) must be 0, but its largest entry is {residual:.3g}; "
                "take the steady trim out first"
            )
        self.require_state(np.zeros(n))
        if self.inverse_dynamics is not None:
            f, g = self.drift, self.control_matrix
            require_inverse(self.name, self.zeta, f, g, self.inverse_dynamics, self.scale)
        if self.periods:
            terms = casadi.horzcat(self.drift, self.control_matrix, self.disturbance_matrix)
            require_periodic(self.name, self.zeta, terms, self.scale, self.state_names, self.periods)

    @property
    def n_states(self) -> int:
        """Number of states n."""
        return int(self.zeta.shape[0])

    @property
    def n_inputs(self) -> int:
        """Number of inputs k of the control."""
        return int(self.control_matrix.shape[1])

    @property
    def same_inputs(self) -> bool:
        """Whether both players enter through the same g, as in the paper."""
        return self.disturbance_matrix is self.control_matrix

    @property
    def input_matrix(self) -> SX:
        """g of both players, (n, k), where they share it.

        Raises
        ------
        InputError
            If control and disturbance enter apart: what asks for this needs g_1 = g_2.
        """
        if not self.same_inputs:
            raise InputError(
                f"{self.name}: control and disturbance enter through different matrices, which the "
                "solvers and the learner do not cover; leave out the disturbance matrix, so that the "
                "disturbance enters like the control"
            )
        return self.control_matrix

    def require_state(self, zeta: ArrayLike) -> Array:
        """Return `zeta` as an array of n finite numbers inside the domain.

        Raises
        ------
        InputError
            One sentence about what is wrong.
        """
        state = require_numbers(zeta, self.state_names)
        fault = self.outside(state)
        if fault is not None:
            raise InputError(fault)
        return state

    def initial_state(self, zeta: ArrayLike) -> Array:
        """Return a state that enters, its angles written the short way; raises as `require_state`.

        Also InputError for an angle of more turns than anybody writes, which is probably in degrees.
        """
        state = require_numbers(zeta, self.state_names)
        self.angles.require_near(state, self.state_names, self.state_units)
        return self.require_state(self.angles.start(state))

    def starts(self, zeta: ArrayLike) -> list[Array]:
        """Return ζ (n,) by each turn from which V* may be least, the short way first.

        Raises as `require_state`, with the angles written the short way.
        """
        first = self.require_state(self.angles.start(require_numbers(zeta, self.state_names)))
        if not self.periods:
            return [first]
        others = self.angles.candidates(first, self.P)[1:]
        return [first, *(other for other in others if self.outside(other) is None)]

    def outside(self, zeta: Array) -> str | None:
        """Return the sentence of a bound of the domain that ζ (n,) does not keep, or None."""
        return outside(self.domain, self._domain, zeta) if self.domain else None

    @property
    def margins(self) -> SX:
        """The margins of the domain as one column, (b,), all positive inside."""
        return casadi.vertcat(*(bound.margin for bound in self.domain))

    @cached_property
    def angles(self) -> Angles:
        """Which states are angles, and how a state is written."""
        return Angles(self.periods or (0.0,) * self.n_states, self.equivalence)

    @cached_property
    def _domain(self) -> casadi.Function:
        return margins_and_shown(self.zeta, self.domain)

    @cached_property
    def linearization(self) -> tuple[Array, Array]:
        """A = ∂f/∂ζ (n, n) and B = g (n, k) at the origin."""
        A = self._at_origin(casadi.jacobian(self.drift, self.zeta))
        return A, self._at_origin(self.input_matrix)

    @cached_property
    def P(self) -> Array:
        """Stabilising game Riccati solution, (n, n): V = ζ'P ζ near the origin."""
        return riccati.game_riccati(*self.linearization, self.game)

    @cached_property
    def P_gamma(self) -> Array:
        """dP/dγ, (n, n), negative semidefinite: ζ'P ζ falls as the disturbance gets dearer."""
        return riccati.gamma_derivative(*self.linearization, self.game, self.P)

    @cached_property
    def linear_gains(self) -> tuple[Array, Array]:
        """K_1 = R^-1 B'P and K_2 = γ^-2 W_d^-1 B'P, each (k, n).

        u_1 = -K_1 ζ and u_2 = K_2 ζ are the linear H-infinity policies.
        """
        _, B = self.linearization
        push = B.T @ self.P
        return self.game.R_inverse @ push, self.game.disturbance_inverse @ push

    @cached_property
    def linear_gain(self) -> Array:
        """-R_eff^-1 B'P, (k, n): v of the linear H-infinity policy is this times ζ."""
        _, B = self.linearization
        return np.asarray(-self.game.R_eff_inverse @ B.T @ self.P)

    @cached_property
    def closed_loop(self) -> Array:
        """A + B `linear_gain`, the linearised game's closed loop [1/s], (n, n)."""
        A, B = self.linearization
        return np.asarray(A + B @ self.linear_gain)

    @cached_property
    def closed_loop_modes(self) -> NDArray[np.complex128]:
        """Eigenvalues of `closed_loop` [1/s], (n,)."""
        return np.asarray(np.linalg.eigvals(self.closed_loop), dtype=np.complex128)

    @property
    def decay_rate(self) -> float:
        """Rate of the slowest mode of the linearised game's closed loop [1/s], positive."""
        return -float(self.closed_loop_modes.real.max())

    @property
    def fastest_rate(self) -> float:
        """Magnitude of the fastest mode of the linearised game's closed loop [1/s]."""
        return float(np.abs(self.closed_loop_modes).max())

    @cached_property
    def gamma_star(self) -> float:
        """Smallest attenuation level γ* of the linearised game [-]."""
        game = self.game
        return riccati.gamma_star(*self.linearization, game.Q, game.R, game.W_d)

    def linearized(self) -> Problem:
        """Return the linear-quadratic game at the origin; its value is ζ'P ζ exactly."""
        A, B = self.linearization
        g = SX(DM(B))
        return replace(
            self,
            name=f"{self.name}, linearised",
            drift=DM(A) @ self.zeta,
            control_matrix=g,
            disturbance_matrix=g,
            domain=(),
            switching=SX(0, 1),
            inverse_dynamics=self._linear_inverse(A, B),
            periods=(),
            equivalence=None,
        )

    def with_game(self, game: Game) -> Problem:
        """Return the same plant under another game."""
        return replace(self, game=game)

    def with_gamma(self, gamma: float) -> Problem:
        """Return the same problem at another attenuation level; the error names γ*."""
        old = self.game
        try:
            return self.with_game(Game(old.Q, old.R, old.W_d, gamma))
        except GammaTooSmallError as error:
            raise GammaTooSmallError(gamma, error.threshold, self.gamma_star) from None

    def _linear_inverse(self, A: Array, B: Array) -> InverseDynamics | None:
        """v = B_2^-1 (a - A_2 ζ) from the lower rows of A and B."""
        if self.inverse_dynamics is None:
            return None
        a, k = self.inverse_dynamics.acceleration, self.n_inputs
        inverse = np.linalg.inv(B[k:])
        return InverseDynamics(a, DM(inverse) @ (a - DM(A[k:]) @ self.zeta))

    def _name(self, what: str, letter: str, number: int) -> None:
        """Fill in names and units that were left out; raises InputError if there are too few."""
        for kind, default in (("names", [f"{letter}{i + 1}" for i in range(number)]), ("units", ["1"])):
            given = tuple(getattr(self, f"{what}_{kind}")) or tuple(default * number)[:number]
            if len(given) != number:
                raise InputError(
                    f"{self.name}: there are {len(given)} {what} {kind}, but {number} {what}s; "
                    "give one for each"
                )
            object.__setattr__(self, f"{what}_{kind}", given)

    def _at_origin(self, expression: SX) -> Array:
        value = casadi.Function("at_origin", [self.zeta], [expression])(np.zeros(self.n_states))
        return np.array(DM(value).full(), dtype=float)


def _equal(a: SX, b: SX) -> bool:
    """Return whether two matrices are the same expressions."""
    return a is b or (a.shape == b.shape and bool(casadi.is_equal(a, b, 100)))
