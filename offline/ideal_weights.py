"""Ideal weights W* of (10), V = W'σ + ε, from certified values and gradients.

With S the half-widths, so that S V_ζ is the gradient with respect to the scaled state, W* minimises

    J(W) = 1/N Σ_i [ (ε_i / V_i)^2 + |S ε'_i|^2 / |S V_ζi|^2 ] + ρ Σ_k (d_k W_k)^2,

ε_i = V_i - W'σ(ζ_i), ε'_i = V_ζi - σ'(ζ_i)'W. A state counts through its relative errors only, of the
value and of the gradient alike, so small states count as much as large ones. d_k is the rms of column k
of the weighted rows: the ridge ρ acts on equal columns, and only where they are collinear to sqrt(ρ).
The paper takes sup|ε| and sup|ε'| on χ as given (Assumption 3); here they are measured on held-out
states.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..symbolic import Basis, InputError
from ..symbolic.arrays import Array
from ..symbolic.compiled import BatchKernel, dense_function
from .solve import OfflineSolution

RIDGE = 1e-10


@dataclass(frozen=True)
class Pairs:
    """Values and gradients of V at N states.

    Attributes
    ----------
    states : (N, n)
    values : (N,), positive
    gradients : (N, n)

    Raises
    ------
    InputError
        If the shapes disagree, there is nothing, or a value or gradient is not finite and positive.
    """

    states: Array
    values: Array
    gradients: Array

    def __post_init__(self) -> None:
        n_pairs = len(self.values)
        shapes = (self.states.shape, self.gradients.shape)
        if self.values.shape != (n_pairs,) or shapes[0] != shapes[1] or shapes[0][:1] != (n_pairs,):
            raise InputError(
                f"{n_pairs} values need as many states and gradients, but their shapes are "
                f"{shapes[0]} and {shapes[1]}"
            )
        norms = np.linalg.norm(self.gradients, axis=-1)
        if not n_pairs or not np.all(np.isfinite(norms) & (norms > 0.0) & (self.values > 0.0)):
            raise InputError(
                "relative errors need states away from the origin with positive finite values"
            )

    @classmethod
    def of(cls, optima: Iterable[OfflineSolution]) -> Pairs:
        """Return the pairs of certified optima; raises InputError if one of them is not certified."""
        found = list(optima)
        for optimum in found:
            if optimum.faults:
                raise InputError(
                    f"the optimum from {np.array2string(optimum.direct.zeta, precision=3)} is not "
                    f"certified: {'; '.join(optimum.faults)}; leave it out"
                )
        states = np.array([optimum.direct.zeta for optimum in found])
        values = np.array([optimum.value for optimum in found])
        return cls(states, values, np.array([optimum.costate for optimum in found]))


@dataclass(frozen=True)
class IdealWeights:
    """The fit.

    Attributes
    ----------
    weights : (m,) W*
    norm : sqrt(J) without the ridge: rms of the relative errors of value and gradient together
    """

    weights: Array
    norm: float


@dataclass(frozen=True)
class ErrorSize:
    """Sizes of an error over states.

    Attributes
    ----------
    sup, rms : of its norm
    sup_relative, rms_relative : of its norm relative to that of what it is an error of
    """

    sup: float
    rms: float
    sup_relative: float
    rms_relative: float

    @classmethod
    def of(cls, error: Array, relative: Array) -> ErrorSize:
        """Take sup and rms over the norms of an error and over its relative norms, each (N,)."""
        return cls(_sup(error), _rms(error), _sup(relative), _rms(relative))


def fit_weights(basis: Basis, pairs: Pairs, ridge: float = RIDGE) -> IdealWeights:
    """Return the weights that minimise J over the pairs; ρ is `ridge`.

    Raises
    ------
    InputError
        If there are too few states for the weights.
    """
    n_pairs, m = len(pairs.values), basis.n_basis
    if n_pairs < least_states(basis):
        raise InputError(
            f"{n_pairs} states don't determine the {m} weights of basis '{basis.name}'; give at least "
            f"{least_states(basis)}"
        )
    rows, target = _weighted(basis, pairs)
    size = np.sqrt(np.mean(rows**2, axis=0) * (basis.n + 1))
    size[size == 0.0] = 1.0
    scaled = np.vstack([rows / size, np.sqrt(ridge * n_pairs) * np.eye(m)])
    solution, *_ = np.linalg.lstsq(scaled, np.append(target, np.zeros(m)), rcond=None)
    weights = solution / size
    residual = target - rows @ weights
    return IdealWeights(weights, float(np.linalg.norm(residual) / np.sqrt(n_pairs)))


def least_states(basis: Basis) -> int:
    """Return the fewest states that can determine the weights.

    As many equations as weights; and n states, since gradients at fewer leave a quadratic form free
    outside of their span, whatever their number.
    """
    return max(-(-basis.n_basis // (basis.n + 1)), basis.n)


def representation_errors(basis: Basis, weights: Array, pairs: Pairs) -> tuple[Array, Array]:
    """Return ε = V - W'σ, (N,), and ε' = V_ζ - σ''W, (N, n)."""
    sigma, sigma_prime = basis_at(basis, pairs.states)
    epsilon = pairs.values - sigma @ weights
    return epsilon, pairs.gradients - np.einsum("pmn,m->pn", sigma_prime, weights)


def error_sizes(basis: Basis, weights: Array, pairs: Pairs) -> tuple[ErrorSize, ErrorSize]:
    """Return the sizes of ε, and of ε': |ε'| as the paper has it, relative in half-widths as in J."""
    epsilon, epsilon_prime = representation_errors(basis, weights, pairs)
    relative = np.linalg.norm(epsilon_prime * basis.scale, axis=1)
    relative /= np.linalg.norm(pairs.gradients * basis.scale, axis=1)
    return (
        ErrorSize.of(epsilon, epsilon / pairs.values),
        ErrorSize.of(np.linalg.norm(epsilon_prime, axis=1), relative),
    )


def basis_at(basis: Basis, states: Array) -> tuple[Array, Array]:
    """Return σ, (N, m), and σ', (N, m, n), at the rows of `states`."""
    outputs = {"sigma": basis.sigma, "sigma_prime": basis.jacobian}
    kernel = BatchKernel(dense_function("basis", {"zeta": basis.zeta}, outputs), compiled=False)
    sigma, flat = kernel(states)
    return sigma, flat.reshape(len(states), basis.n, basis.n_basis).transpose(0, 2, 1)


def _weighted(basis: Basis, pairs: Pairs) -> tuple[Array, Array]:
    """Return the rows of J, (N (n + 1), m), and what they should give, (N (n + 1),)."""
    sigma, sigma_prime = basis_at(basis, pairs.states)
    norms = np.linalg.norm(pairs.gradients * basis.scale, axis=1)
    scale = basis.scale / norms[:, None]
    gradient_rows = (sigma_prime * scale[:, None, :]).transpose(0, 2, 1)
    rows = np.concatenate([(sigma / pairs.values[:, None])[:, None, :], gradient_rows], axis=1)
    target = np.column_stack([np.ones(len(norms)), pairs.gradients * scale])
    return rows.reshape(-1, basis.n_basis), target.ravel()


def _sup(values: Array) -> float:
    return float(np.abs(values).max())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
