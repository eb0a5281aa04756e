"""Learned value and policy held against the optimum: along the way, around it, over the envelope."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...offline import Pairs, Plant, QuickValue, error_sizes, fit_weights
from ...offline.ideal_weights import least_states
from ...online.paper import BellmanTerms, bellman_error
from ...symbolic import InputError, Problem, RunError, Setup
from ...symbolic.arrays import Array
from ...symbolic.errors import nearest
from ..optima import TRAINING, Bounds, Ideal, envelope_states, unit_text
from ..records import provenance, reused
from ..scenario import Scenario
from .pace import pace
from .words import quantity

N_ALONG, N_FIT, N_SIDE = 40, 300, 41
LEAST_LEFT = 1e-5  # of the cost: after it errors are those of the simulation
FIELD_TIME = 2.0  # s, at the pace of the shipped vehicle


@dataclass(frozen=True)
class Field:
    """The two states over which the Bellman error is drawn, by their number."""

    rows: int
    columns: int

    @classmethod
    def of(cls, text: str | None, problem: Problem) -> Field | None:
        """Return the field of 'ROWS,COLUMNS', two states by name or by number from 1.

        The first two states if there is no text; None for a problem of one state.

        Raises
        ------
        InputError
            Unless these are two different states.
        """
        states = problem.state_names
        if text is None:
            return cls(0, 1) if problem.n_states > 1 else None
        names = [name.strip() for name in text.split(",")]
        numbers = {str(i + 1): i for i in range(problem.n_states)}
        found = {**numbers, **{name: i for i, name in enumerate(states)}}
        for name in names:
            if name not in found:
                raise InputError(f"there is no state '{name}': {nearest(name, states)}")
        if len(names) != 2 or found[names[0]] == found[names[1]]:
            example = ",".join(states[:2])
            raise InputError(
                f"--field is '{text}', but must be two different states, such as {example}"
            )
        return cls(found[names[0]], found[names[1]])


def analysis_record(
    scenario: Scenario, learned: xr.Dataset, field: Field | None, path: Path | None = None
) -> xr.Dataset:
    """Return what figures show of a learned run against the optimum, from `path` if it is there.

    Along the learned trajectory (`time`): V* and V̂ = Ŵ_c'σ (13), ζ'Pζ, and for both policies the
    relative error of the value and of u_1 against u_1* = -R^-1 g'V_ζ'/2 (8), in the norm of R.
    Where a field is given, over its two states (`row`, `column`), the others as they are at one moment:
    δ / ζ'Qζ of (17) with Riccati's weights and with those in use then. `ideal_weights`: the best fit of
    the basis to V* and its gradient from seeded states of the envelope.
    """
    kind = f"analysis of {learned.attrs['key']} over {field}"
    attributes = provenance(scenario, kind)
    return reused(path, attributes["key"], lambda: _analysis(scenario, learned, field, attributes))


def _analysis(
    scenario: Scenario, learned: xr.Dataset, field: Field | None, attributes: dict[str, Any]
) -> xr.Dataset:
    setup = scenario.setup()
    value = QuickValue(setup.problem)
    parts = [_along(setup, learned, value)]
    if field is not None:
        parts.append(_around(setup, learned, field))
    pairs = optimal_pairs(setup, value, N_FIT, scenario.samples.seed)
    parts.append(_ideal(setup, pairs))
    merged = xr.merge(parts, combine_attrs="no_conflicts")
    return merged.assign_attrs(attributes)


def optimal_pairs(
    setup: Setup, value: QuickValue, n_states: int, seed: int, stream: int = TRAINING
) -> Pairs:
    """Return V* and its gradient at seeded states of the envelope, those where an optimum is found."""
    found = []
    for state in envelope_states(setup.envelope, n_states, seed, stream):
        with suppress(RunError):
            found.append((state, *value.with_costate(state)))
    if not found:
        none = np.zeros((0, setup.problem.n_states))
        return Pairs(none, np.zeros(0), none)
    kept, values, gradients = (np.array(part) for part in zip(*found, strict=True))
    return Pairs(kept, values, gradients)


def _ideal(setup: Setup, pairs: Pairs) -> xr.Dataset:
    """Return W*, the fit of the basis to optima of the envelope, and these; NaN if they are too few."""
    enough = len(pairs.values) >= least_states(setup.basis)
    weights = np.full(setup.basis.n_basis, np.nan)
    units = {"units": unit_text(setup.problem.state_units)}
    if enough:
        weights = fit_weights(setup.basis, pairs).weights
    return xr.Dataset(
        {
            "ideal_weights": ("basis", weights, {"units": "cost"}),
            "optimum_zeta": (("optimum", "state"), pairs.states, units),
            "optimum_value": ("optimum", pairs.values, {"units": "cost"}),
            "optimum_costate": (
                ("optimum", "state"),
                pairs.gradients,
                {"units": "cost per unit of the state"},
            ),
        }
    )


def ideal_of(setup: Setup, analysis: xr.Dataset) -> Ideal | None:
    """Return the ideal weights of an analysis, with ε and ε' at the states of the fit; None if NaN."""
    weights = analysis["ideal_weights"].values
    if not np.all(np.isfinite(weights)):
        return None
    names = ("optimum_zeta", "optimum_value", "optimum_costate")
    pairs = Pairs(*(analysis[name].values for name in names))
    epsilon, epsilon_prime = error_sizes(setup.basis, weights, pairs)
    return Ideal(weights, pairs, Bounds(epsilon.sup, epsilon_prime.sup, len(pairs.values)))


def weights_in_use(learned: xr.Dataset, name: str, times: Array) -> Array:
    """Return the weights of a record in use at `times`, (T, m): each step's are recorded before it."""
    weights = learned[name].values
    after = np.searchsorted(learned["learn_time"].values, times, side="right")
    return np.asarray(weights[np.minimum(after, len(weights) - 1)])


def _along(setup: Setup, learned: xr.Dataset, value: QuickValue) -> xr.Dataset:
    """Return the errors at moments of the learned run."""
    problem, game, plant = setup.problem, setup.game, Plant(setup.problem)
    zeta, time = learned["zeta"].values, learned["time"].values
    linear_values = np.einsum("ti,ij,tj->t", zeta, problem.P, zeta)
    over = np.flatnonzero(linear_values > LEAST_LEFT * linear_values.max())
    last = int(over[-1]) if len(over) else len(time) - 1
    chosen = np.unique(np.linspace(0, last, N_ALONG).astype(int))
    critic = weights_in_use(learned, "critic", time[chosen])
    columns: dict[str, list[float]] = {name: [] for name in _ALONG}
    for i, weights in zip(chosen, critic, strict=True):
        try:
            optimum, costate = value.with_costate(zeta[i])
        except RunError:
            optimum, costate = np.nan, np.full(problem.n_states, np.nan)
        _, g = plant.terms(zeta[i])
        u_star = -0.5 * game.R_inverse @ g.T @ costate
        estimate = float(weights @ setup.functions.sigma(zeta[i])[0])
        linear = -problem.linear_gains[0] @ zeta[i]
        controls = {"learned": learned["u_control"].values[i], "linear": linear}
        columns["value"].append(optimum)
        columns["value_learned"].append(estimate)
        columns["value_linear"].append(linear_values[i])
        for name, guess in (("learned", estimate), ("linear", linear_values[i])):
            columns[f"value_error_{name}"].append(abs(guess - optimum) / optimum)
            gap = controls[name] - u_star
            squared = (gap @ game.R @ gap) / (u_star @ game.R @ u_star)
            columns[f"policy_error_{name}"].append(float(np.sqrt(squared)))
    data = {name: (("time",), np.array(columns[name]), {"units": _ALONG[name]}) for name in _ALONG}
    return xr.Dataset(data, {"time": ("time", time[chosen], {"units": "s"})})


_ALONG = {
    **dict.fromkeys(("value", "value_learned", "value_linear"), "cost"),
    **{f"{kind}_error_{name}": "1" for kind in ("value", "policy") for name in ("learned", "linear")},
}


def _around(setup: Setup, learned: xr.Dataset, field: Field) -> xr.Dataset:
    """Return the relative Bellman error over two states around the run."""
    zeta, time = learned["zeta"].values, learned["time"].values
    moment = int(np.searchsorted(time, min(FIELD_TIME / pace(setup), 0.5 * time[-1])))
    here = zeta[moment]
    scale = np.maximum(1.5 * np.abs(zeta[0]), 0.3 * setup.envelope)
    row, column = (np.linspace(-scale[i], scale[i], N_SIDE) for i in (field.rows, field.columns))
    points = np.tile(here, (N_SIDE * N_SIDE, 1))
    points[:, field.rows], points[:, field.columns] = np.repeat(row, N_SIDE), np.tile(column, N_SIDE)
    terms = BellmanTerms.at(points, setup.functions.at(points), setup.game)
    weights = {"linear": (setup.riccati_weights,) * 3}
    in_use = [weights_in_use(learned, n, time[[moment]])[0] for n in ("critic", "actor_1", "actor_2")]
    weights["learned"] = (in_use[0], in_use[1], in_use[2])
    size = np.where(terms.state_cost > 0.0, terms.state_cost, np.nan)  # NaN at the origin
    data: dict[str, Any] = {}
    for name, three in weights.items():
        relative = bellman_error(terms, setup.game, *three).delta / size
        data[f"field_{name}"] = (("row", "column"), relative.reshape(N_SIDE, N_SIDE), {"units": "1"})
    attributes: dict[str, Any] = {"field_time": float(time[moment])}
    for side, i in (("rows", field.rows), ("columns", field.columns)):
        name, unit = setup.problem.state_names[i], setup.problem.state_units[i]
        attributes |= {f"field_{side}": quantity(name, unit), f"field_{side}_value": here[i]}
        data[f"way_{side}"] = ("way", zeta[::10, i], {"units": unit})
    return xr.Dataset(data, {"row": row, "column": column}, attributes)
