"""Rows of the costate error along predicted trajectories of a policy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from ...symbolic import PredictedPath, Prediction
from ...symbolic.arrays import Array

VALUE_SHARE = 1e-2  # of a relative square error of the value, beside one of relative regret
RelativeTo = Literal["rest", "whole"]


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
    prediction : of the paths
    points : of each path that give rows
    relative_to : what the weights are relative to
    """

    def __init__(self, prediction: Prediction, points: int, relative_to: RelativeTo = "rest") -> None:
        self._prediction = prediction
        self._relative_to = relative_to
        steps = prediction.steps
        edges = np.unique(np.linspace(0, len(steps), points + 1).astype(int))
        self._nodes = edges[:-1]
        gaps = np.diff(np.append(0.0, np.cumsum(steps))[edges])
        self._spans = gaps if relative_to == "rest" else _trapezoids(gaps)

    def build(self, paths: int) -> Iterator[str]:
        """Build what so many paths at once need, and yield the names of the functions.

        Rows of fewer paths too: some may be lost.
        """
        yield from self._prediction.build([k * len(self._nodes) for k in range(1, paths + 1)])

    def at(self, starts: Array, actor_1: Array, actor_2: Array) -> tuple[Array, Array, Array]:
        """Return ω (N, m), targets (N,) and weights (N,) of the paths from the rows of `starts`.

        Paths that leave, or that cost nothing since the start is the origin, give no rows.
        """
        found = [self._prediction.costates(z, actor_1, actor_2) for z in starts]
        usable = [path for path in found if 0.0 < path.cost < np.inf]
        return self._stacked(usable) if usable else self.none()

    def none(self) -> tuple[Array, Array, Array]:
        """Return no rows, as `at` does."""
        return np.zeros((0, self._prediction.basis.n_basis)), np.zeros(0), np.zeros(0)

    def _stacked(self, paths: list[PredictedPath]) -> tuple[Array, Array, Array]:
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
