"""The Bellman error's rows and the critic's sums in compiled vector code, `vector_rows.c`.

It computes what `paper.bellman_error`, `critic.row_weights` and `critic.NormalEquations` do in numpy,
from σ' and g without their zeros, for the samples and the state at once. The gradient law's flow

    y_dot = -A y + b,  y(0) = 0,    A = η Σ w ω ω' + leash >= 0,    b = η Σ w ω δ

is found in the Krylov space of b, from products A x alone. With Lanczos' relation A V = V T + β v e_n'
the approximation y_n = V z, z_dot = -T z + |b| e_1, leaves y_n_dot + A y_n - b = β z_n v, and because
A >= 0

    |y - y_n| <= β ∫_0^dt |z_n| = β |∫_0^dt z_n|,

the last since z_n keeps its sign: T has positive off-diagonals, so that exp(-T t) has the signs of
(-1)^(i+j). This bound ends the iteration.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...symbolic import ValueFunctions
from ...symbolic.arrays import Array
from ..laws import Normalizer, exact_flow

TOLERANCE = 1e-11  # of the Krylov flow, relative to its length
_MOST = 64  # Lanczos vectors, as in the C code
_NORMALIZERS: tuple[Normalizer, ...] = ("paper", "squared", "state_cost")
_INTEGERS = ("blocks", "m", "n", "k", "entries", "normalizer")
_INDICES = ("column", "row", "input", "state")
_ARRAYS = (
    "R_inverse",
    "D_inverse",
    "terms",
    "gains",
    "omega",
    "local_cost",
    "delta",
    "weights",
    "work",
)


class _Table(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_longlong) for name in _INTEGERS),
        ("floor", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in (*_INDICES, *_ARRAYS)),
    )


def _aligned(*shape: int) -> Array:
    """Return zeros that begin at a multiple of 64 bytes, as the vectors of the C code must."""
    size = int(np.prod(shape))
    raw = np.zeros(size + 8)
    start = -(raw.ctypes.data // 8) % 8
    return raw[start : start + size].reshape(shape)


@dataclass(frozen=True)
class RowGains:
    """η_c and the kind of the row weights.

    Attributes
    ----------
    state, samples : η_c of the row at the state and of every sample's [1/s]
    normalizer, floor : of `critic.row_weights`
    """

    state: float
    samples: float
    normalizer: Normalizer
    floor: float


class VectorRows:
    """Rows of (17) at N samples and at the state, under changing weights.

    Parameters
    ----------
    functions : of problem and basis
    compiled : the C code
    n_samples : N
    gains : of the rows
    """

    def __init__(
        self, functions: ValueFunctions, compiled: ctypes.CDLL, n_samples: int, gains: RowGains
    ) -> None:
        self._functions, self._library, self._n_samples = functions, compiled, n_samples
        layout, problem, m = functions.term_layout, functions.problem, functions.basis.n_basis
        lanes = ctypes.c_longlong.in_dll(compiled, "lanes").value
        blocks, width = 2 * -(-(n_samples + 1) // (2 * lanes)), 8 * -(-m // 8)
        n, k = problem.n_states, problem.n_inputs
        shapes = {"terms": (layout.n_entries,), "omega": (width,)}
        per_block = {name: _aligned(blocks, *shapes.get(name, ()), lanes) for name in _ARRAYS[2:-1]}
        game = problem.game
        self._kept = {
            **{name: getattr(layout, name) for name in _INDICES},
            "R_inverse": np.ascontiguousarray(game.R_inverse),
            "D_inverse": np.ascontiguousarray(game.disturbance_inverse),
            **per_block,
            "work": _aligned(3 * n + 2 * k + width, lanes),
        }
        kind = _NORMALIZERS.index(gains.normalizer)
        addresses = {name: array.ctypes.data for name, array in self._kept.items()}
        self._table = _Table(
            blocks, width, n, k, layout.n_entries, kind, floor=gains.floor, **addresses
        )
        flat = per_block["gains"].reshape(-1)
        flat[:n_samples], flat[n_samples] = gains.samples, gains.state
        self._delta = per_block["delta"].reshape(-1)
        state_block, state_lane = divmod(n_samples, lanes)
        self._terms, self._lanes = per_block["terms"], lanes
        self._here = per_block["terms"][state_block, :, state_lane]
        self._state_cost = np.ones(n_samples)
        self._vectors = _aligned(6, width)  # critic, both actors, gradient, leash, flow
        self._pointers = [int(row.ctypes.data) for row in self._vectors]
        self._krylov = _aligned(_MOST + 1, width)
        self._matrix = _aligned(width, width)
        self._address = ctypes.addressof(self._table)
        self._point = functions.terms

    def place(self, points: Array) -> None:
        """Evaluate the terms at the sample points (N, n)."""
        (terms,) = self._functions.many_terms(points)
        by_lane = self._terms.transpose(0, 2, 1)
        whole = len(points) // self._lanes
        inside = whole * self._lanes
        by_lane[:whole] = terms[:inside].reshape(whole, self._lanes, terms.shape[1])
        by_lane[whole, : len(points) - inside] = terms[inside:]
        self._state_cost = terms[:, -1].copy()

    def observe(
        self, zeta: Array, weights: tuple[Array, Array, Array], leash: Array, reference: Array
    ) -> tuple[float, float, VectorEquations]:
        """Return δ at ζ (n,), the rms of δ_j / ζ_j'Qζ_j, and the equations of the critic.

        The equations hold until the next call.

        Parameters
        ----------
        weights : critic, actor_1, actor_2, each (m,)
        leash, reference : (m,) strengths ρ and W_ref
        """
        point = self._point
        point.inputs[0][...] = zeta
        point.evaluate()
        self._here[...] = point.outputs[0]
        m = len(leash)
        vectors = self._vectors
        vectors[0, :m], vectors[1, :m], vectors[2, :m] = weights
        vectors[4, :m] = leash
        self._library.bellman(self._address, *self._pointers[:4])
        vectors[3, :m] += leash * (weights[0] - reference)
        relative = self._delta[: self._n_samples] / self._state_cost
        error = float(np.sqrt(relative @ relative / self._n_samples))
        return (
            float(self._delta[self._n_samples]),
            error,
            VectorEquations(self, vectors[3, :m].copy(), leash),
        )

    def flow(self, dt: float) -> Array | None:
        """Return y(dt), shape (padded m,), or None where the Krylov space would have to be large."""
        *_, gradient, leash, moved = self._pointers
        found = self._library.flow(
            self._address, leash, gradient, dt, TOLERANCE, self._krylov.ctypes.data, moved
        )
        return self._vectors[5] if found >= 0 else None

    def normal_matrix(self, m: int) -> Array:
        """Return η Σ w ω ω' (m, m), without leash; overwritten by the next call."""
        self._library.normal(self._address, self._matrix.ctypes.data)
        return self._matrix[:m, :m]


@dataclass(frozen=True)
class VectorEquations:
    """The critic's equations of compiled rows, as `critic.NormalEquations`.

    Attributes
    ----------
    rows : of which they are
    gradient : (m,) η Σ w ω δ and the leash's pull
    leash : (m,) ρ
    """

    rows: VectorRows
    gradient: Array
    leash: Array

    @cached_property
    def matrix(self) -> Array:
        """η Σ w ω ω' and the leash, shape (m, m)."""
        m = len(self.leash)
        matrix = self.rows.normal_matrix(m).copy()
        matrix.ravel()[:: m + 1] += self.leash
        return matrix

    def flow(self, dt: float) -> Array:
        """Return y(dt), to 1e-11 of its length; by the eigenvalues where the Krylov space is large."""
        moved = self.rows.flow(dt)
        return exact_flow(self.matrix, self.gradient, dt) if moved is None else moved[: len(self.leash)]
