"""What the critic learns from: rows of the Bellman error, or of the costate error.

Either way a row is (ω, r, w) with the error δ = r + ω'Ŵ_c and the weight w, so both serve every law of
`critic`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from ...symbolic import Path, Prediction
from ...symbolic.arrays import Array
from ..paper import BellmanTerms, Residual
from .samples import Predict, SampleStrategy, around

VALUE_SHARE = 1e-2  # of a relative square error of the value, beside one of relative regret
RelativeTo = Literal["rest", "whole"]
Weights = tuple[Array, Array, Array]  # critic, actor_1, actor_2


@dataclass(frozen=True)
class SampleRows:
    """Rows at the samples, for given weights.

    Attributes
    ----------
    residual : ω (N, m), r (N,) and δ (N,)
    weights : (N,) w, without the gain
    error : rms of the relative error [-]
    """

    residual: Residual
    weights: Array
    error: float

    def __len__(self) -> int:
        return len(self.weights)


class RowSource(Protocol):
    """Where the sample rows come from."""

    def move(self, zeta: Array, weights: Weights) -> None:
        """Go to where rows are wanted at the state ζ (n,) under the present weights."""
        ...

    def rows(self, weights: Weights) -> SampleRows | None:
        """Return the rows under the present weights, or None without samples."""
        ...


class BellmanSource:
    """Rows of the Bellman error (17) at sample points.

    Parameters
    ----------
    strategy : where the points are
    terms : (17)'s terms at points (N, n)
    residual : δ and ω of terms under weights
    row_weights : w from ω (N, m) and ζ'Qζ (N,)
    predict : the path from ζ under actor weights
    placed : is told where the points are
    """

    def __init__(
        self,
        strategy: SampleStrategy,
        terms: Callable[[Array], BellmanTerms],
        residual: Callable[[BellmanTerms, Weights], Residual],
        row_weights: Callable[[Array, Array], Array],
        predict: Callable[[Array, Array, Array], Path],
        placed: Callable[[Array], None],
    ) -> None:
        self._strategy = strategy
        self._evaluate, self._residual, self._row_weights = terms, residual, row_weights
        self._predict, self._placed = predict, placed
        self._terms: BellmanTerms | None = None
        self._place(strategy.first())

    def move(self, zeta: Array, weights: Weights) -> None:
        """Move the points, and evaluate f, g and σ' there, if the strategy moves them."""
        path: Predict = lambda: self._predict(zeta, *weights[1:])  # noqa: E731
        points = self._strategy.moved(zeta, path) if len(self._points) else None
        if points is not None:
            self._place(points)

    def rows(self, weights: Weights) -> SampleRows | None:
        """Return the rows under the present weights; the relative error is δ / ζ'Qζ."""
        if not len(self._points):
            return None
        if self._terms is None:
            self._terms = self._evaluate(self._points)
        residual = self._residual(self._terms, weights)
        relative = residual.delta / self._terms.state_cost
        return SampleRows(
            residual,
            self._row_weights(residual.omega, self._terms.state_cost),
            float(np.sqrt(np.mean(relative**2))),
        )

    def _place(self, points: Array) -> None:
        self._points = points
        self._terms = None
        self._placed(points)


class PathRows:
    """Rows of the costate error along predicted trajectories of a policy.

    With v = u_1 + u_2 the policy v̂ of any weights W costs, from any state,

        J(v̂) - V = ∫ (v̂ - v*)'R_eff (v̂ - v*) dt = ∫ |L g'(σ'^T W - V_ζ')|^2 dt,    L'L = R_eff^-1 / 4

    along its own trajectory (completing the square in (7)). V_ζ' is not known, but the gradient λ of
    the present policy's cost J is (`symbolic.prediction`), and going to the policy of λ is a step of
    policy iteration. So the rows are δ = L g'(σ'^T Ŵ_c - λ), k of them a point, weights Δt / J:
    their sum of squares is the regret over the paths, relative to what is left to pay at each point
    (`rest`), or to the whole cost J_0 of each path (`whole`). With the latter, and at Ŵ_c = W, the
    weights of the policy,

        2 Σ w ω δ = Δt Σ ∂v̂/∂W' (2 R_eff v̂ + g'λ) / J_0 = ∂(ln J_0)/∂W,

    so that fitting the rows is a Gauss-Newton step on the mean of ln J_0 over the starts. The points
    of `rest` count for the time until the next one, which favours where the vehicle is (with trapezoids
    the learner does less well); those of `whole` by the trapezoidal rule.

    g'σ'^T says nothing of functions of the position alone, which no policy depends on. What they are
    worth comes from rows of the value itself, σ'Ŵ_c - J, relative to J, with a share that is small.

    The Bellman error (17) says the same of V_ζ F alone, the slope of V along the path. What the policy
    needs is g'V_ζ, which it has to infer from how the slope differs from point to point.

    Parameters
    ----------
    prediction, steps : of the paths
    points : of each path that give rows
    relative_to : what the weights are relative to
    """

    def __init__(
        self, prediction: Prediction, steps: Array, points: int, relative_to: RelativeTo = "rest"
    ) -> None:
        self._prediction = prediction
        self._steps = steps
        self._relative_to = relative_to
        edges = np.unique(np.linspace(0, len(steps), points + 1).astype(int))
        self._nodes = edges[:-1]
        gaps = np.diff(np.append(0.0, np.cumsum(steps))[edges])
        self._spans = gaps if relative_to == "rest" else _trapezoids(gaps)

    def at(self, starts: Array, actor_1: Array, actor_2: Array) -> tuple[Array, Array, Array] | None:
        """Return ω (N, m), targets (N,) and weights (N,) of the paths from the rows of `starts`.

        Paths that leave, or that cost nothing since the start is the origin, give no rows; None when
        there is no other.
        """
        found = [self._prediction.costates(z, actor_1, actor_2, self._steps) for z in starts]
        usable = [path for path in found if 0.0 < path.cost < np.inf]
        return self._stacked(usable) if usable else None

    def _stacked(self, paths: list[Path]) -> tuple[Array, Array, Array]:
        points = np.vstack([path.states[self._nodes] for path in paths])
        costates = np.vstack([path.costates[self._nodes] for path in paths])  # type: ignore[index]
        regressors, targets, sigma = self._prediction.rows(points, costates)
        k, m = regressors.shape[1:]
        to_go = np.concatenate([path.cost_to_go[self._nodes] for path in paths])
        # what is left to pay is the difference of two large numbers: no rows where rounding owns it
        whole = np.repeat([path.cost for path in paths], len(self._nodes))
        least = 1e-9 * whole
        spans = np.where(to_go > least, np.tile(self._spans, len(paths)), 0.0) / len(paths)
        floored = np.maximum(to_go, least)
        unit = floored if self._relative_to == "rest" else whole
        value_weights = VALUE_SHARE * spans / (self._spans.sum() * floored**2)
        return (
            np.vstack([regressors.reshape(-1, m), sigma]),
            np.concatenate([targets.reshape(-1), to_go]),
            np.append(np.repeat(spans / unit, k), value_weights),
        )


def _trapezoids(gaps: Array) -> Array:
    """Return the weights of points with these gaps after them; the last has the whole last gap."""
    spans = gaps / 2.0
    spans[1:] += gaps[:-1] / 2.0
    spans[-1] += gaps[-1] / 2.0
    return np.asarray(spans)


class CostateSource:
    """Rows of the costate error along paths from the state and from around it.

    Parameters
    ----------
    path_rows : of the predicted paths
    half_widths : (n,) with x = ζ / half_widths
    paths : how many; the first starts at the state, the others around it
    spread : of the other starts, as a part of max_i |x_i|
    seed : of their directions, new ones at every step
    """

    def __init__(
        self, path_rows: PathRows, half_widths: Array, *, paths: int, spread: float, seed: int
    ) -> None:
        self._path_rows = path_rows
        self._half_widths = half_widths
        self._paths, self._spread = paths, spread
        self._rng = np.random.default_rng(seed)
        self._data: tuple[Array, Array, Array] | None = None

    def move(self, zeta: Array, weights: Weights) -> None:
        """Predict the paths and their costates under the present actors."""
        centers = np.tile(zeta, (self._paths - 1, 1))
        starts = np.vstack([zeta, around(centers, self._half_widths, self._spread, self._rng)])
        self._data = self._path_rows.at(starts, *weights[1:])

    def rows(self, weights: Weights) -> SampleRows | None:
        """Return the rows under the present critic; the error is the root of the relative regret."""
        if self._data is None:
            return None
        omega, target, spans = self._data
        delta = omega @ weights[0] - target
        error = float(np.sqrt(spans @ delta**2))
        return SampleRows(Residual(omega=omega, local_cost=-target, delta=delta), spans, error)
