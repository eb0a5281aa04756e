"""Compiled functions of a problem and a basis: what the learner evaluates at states and samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi
from casadi import DM, MX, SX

from ..arrays import Array
from ..compiled import BatchKernel, Export, Kernel, dense_function, export
from ..game import Problem
from .basis import Basis
from .prediction import Prediction
from .sparse_terms import TermLayout, sparse_terms
from .stepping import stepping_of


@dataclass(frozen=True)
class PointTerms:
    """f, g and σ' at N points.

    f : (N, n); g : (N, n, k); sigma_prime : (N, m, n)
    """

    f: Array
    g: Array
    sigma_prime: Array


class ValueFunctions:
    """Compiled σ, σ', the sample kernel and the policies of a problem and a basis.

    Each is built when first used.
    """

    def __init__(self, problem: Problem, basis: Basis, *, compiled: bool = True) -> None:
        self.problem = problem
        self.basis = basis
        self.compiled = compiled
        self._exports: dict[str, Export] = {}
        self._samplers: dict[int, Kernel] = {}
        self._predictions: dict[tuple[float, int], Prediction] = {}

    @cached_property
    def sigma(self) -> Kernel:
        """σ(ζ) from zeta, shape (m,)."""
        return self._export("sigma", {"zeta": self.basis.zeta}, {"sigma": self.basis.sigma})

    @cached_property
    def sigma_prime(self) -> Kernel:
        """σ'(ζ) from zeta, shape (m, n)."""
        outputs = {"sigma_prime": self.basis.jacobian}
        return self._export("sigma_prime", {"zeta": self.basis.zeta}, outputs)

    @cached_property
    def policies(self) -> Kernel:
        """û_1 (14) and û_2 (15) from zeta, actor_1 (m,) and actor_2 (m,)."""
        zeta, m, game = self.problem.zeta, self.basis.n_basis, self.problem.game
        weights = {"actor_1": SX.sym("actor_1", m), "actor_2": SX.sym("actor_2", m)}
        # σ'W as the gradient of W'σ: one reverse sweep instead of m rows
        push = [self._gradient(weight) for weight in weights.values()]
        g = self.problem.input_matrix
        outputs = {
            "u_control": -0.5 * DM(game.R_inverse) @ g.T @ push[0],
            "u_disturbance": 0.5 * DM(game.disturbance_inverse) @ g.T @ push[1],
        }
        return self._export("policies", {"zeta": zeta, **weights}, outputs)

    def sampler(self, n_samples: int) -> Kernel:
        """Return the sample kernel: f, g and σ' at N points, from points (n, N).

        Results: f (n, N), g (n, k N), sigma_prime (m, n N), points side by side.
        """
        if n_samples not in self._samplers:
            point = self._point_function()
            points = MX.sym("points", self.problem.n_states, n_samples)
            mapped = point.map(n_samples, "serial")(points) if n_samples > 1 else point(points)
            names = ["f", "g", "sigma_prime"]
            function = casadi.Function("sample_kernel", [points], [*mapped], ["points"], names)
            operations = point.n_instructions() * n_samples
            self._samplers[n_samples] = self._export_mapped(function, operations)
        return self._samplers[n_samples]

    def at(self, points: Array) -> PointTerms:
        """Return f, g and σ' at the rows of `points`, shape (N, n), from one library for every N."""
        f, g, sigma_prime = self._at_points(points)
        n = self.problem.n_states
        return PointTerms(f, _matrices(g, n), _matrices(sigma_prime, self.basis.n_basis))

    @cached_property
    def _at_points(self) -> BatchKernel:
        return BatchKernel(self._point_function(), compiled=self.compiled)

    @cached_property
    def term_layout(self) -> TermLayout:
        """Layout of the sparse terms."""
        return self._sparse_terms[1]

    @cached_property
    def terms(self) -> Kernel:
        """σ', f, g and ζ'Qζ from zeta, without zeros, as `term_layout` says."""
        kernel, described = export(self._sparse_terms[0], compiled=self.compiled)
        self._exports["sparse_terms"] = described
        return kernel

    @cached_property
    def many_terms(self) -> BatchKernel:
        """The sparse terms at the rows of points (N, n), shape (N, entries)."""
        return BatchKernel(self._sparse_terms[0], compiled=self.compiled)

    @cached_property
    def _sparse_terms(self) -> tuple[casadi.Function, TermLayout]:
        return sparse_terms(self.problem, self.basis)

    def prediction(self, horizon: float, n_steps: int) -> Prediction:
        """Return the predicted closed loop of N steps over a horizon [s], and its costates."""
        if (horizon, n_steps) not in self._predictions:
            stepping = stepping_of(self.problem, horizon, n_steps)
            self._predictions[horizon, n_steps] = Prediction(
                self.problem, self.basis, stepping, self._export_mapped
            )
        return self._predictions[horizon, n_steps]

    def exports(self, n_samples: int) -> Iterator[Export]:
        """Build every function and yield what became of it."""
        for name in ("sigma", "sigma_prime", "policies"):
            getattr(self, name)
            yield self._exports[name]
        self._at_points  # noqa: B018 - compiled with the others, though it has no row of its own
        self.sampler(n_samples)
        yield self._exports["sample_kernel"]

    def exported(self, name: str) -> Export:
        """Return what became of a function that is built."""
        return self._exports[name]

    def _gradient(self, weights: SX) -> SX:
        sigma, zeta = self.basis.sigma, self.problem.zeta
        return casadi.gradient(casadi.dot(weights, sigma), zeta)

    def _point_function(self) -> casadi.Function:
        zeta, problem = self.problem.zeta, self.problem
        outputs = {
            "f": problem.drift,
            "g": problem.input_matrix,
            "sigma_prime": self.basis.jacobian,
        }
        return dense_function("point", {"zeta": zeta}, outputs)

    def _export_mapped(
        self, function: casadi.Function, operations: int, constants: Sequence[Array] = ()
    ) -> Kernel:
        kernel, described = export(
            function, compiled=self.compiled, operations=operations, constants=constants
        )
        self._exports[function.name()] = described
        return kernel

    def _export(self, name: str, inputs: dict[str, SX], outputs: dict[str, SX]) -> Kernel:
        kernel, described = export(dense_function(name, inputs, outputs), compiled=self.compiled)
        self._exports[name] = described
        return kernel


def _matrices(entries: Array, rows: int) -> Array:
    """Return (N, entries of a column-major matrix) as (N, rows, columns) without a copy."""
    return entries.reshape(len(entries), -1, rows).transpose(0, 2, 1)
