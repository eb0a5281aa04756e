"""Ideal weights of a scenario's basis: certified pairs over its envelope, the fit and its errors."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...offline import ErrorSize, Pairs, Plant, error_sizes, fit_weights
from ...offline.ideal_weights import least_states, representation_errors
from ...online.records import read_parts, versions
from ...symbolic import InputError, RunError, Setup
from ...symbolic.arrays import Array
from ..records import OFFLINE_KEY, provenance
from ..scenario import Scenario
from .optima import Optima, record_path, unit_text

KIND = "ideal weights"
IDEAL_KEY = OFFLINE_KEY | {"basis"}
SIZES = ("epsilon", "epsilon_prime", "policy")
TRAINING, HELD_OUT = 0, 1
_PAIRS = ("zeta", "value", "costate", "held_out_zeta", "held_out_value", "held_out_costate")


@dataclass(frozen=True)
class Fit:
    """Ideal weights and their errors over states that they were not fitted to.

    Attributes
    ----------
    weights : (m,) W*
    norm : rms of the relative errors over the training states, see `offline.ideal_weights`
    epsilon, epsilon_prime : of V and of its gradient
    policy : of v = -R_eff^-1 g'V_ζ / 2, in the norm of R_eff [sqrt(cost/s)]
    """

    weights: Array
    norm: float
    epsilon: ErrorSize
    epsilon_prime: ErrorSize
    policy: ErrorSize


@dataclass(frozen=True)
class Bounds:
    """The numbers of Assumption 3 as held-out states show them.

    Attributes
    ----------
    epsilon, epsilon_prime : sup|ε| and sup|ε'|
    n_states : held-out states behind them
    """

    epsilon: float
    epsilon_prime: float
    n_states: int


@dataclass(frozen=True)
class Ideal:
    """What a file of ideal weights holds.

    Attributes
    ----------
    weights : (m,) W*
    pairs : every certified state, fitted to or held out, with its value and gradient
    bounds : on ε and ε', over the held-out ones
    """

    weights: Array
    pairs: Pairs
    bounds: Bounds


def load_ideal(scenario: Scenario, path: Path) -> Ideal:
    """Return ideal weights from their file.

    Raises
    ------
    InputError
        If it is none, or of another vehicle, game, envelope, basis or offline solver.
    """
    try:
        attributes, parts = read_parts(path, "ideal_weights", "epsilon", *_PAIRS)
        epsilon, epsilon_prime = attributes["epsilon_sup"], attributes["epsilon_prime_sup"]
    except (InputError, KeyError):
        raise InputError(
            f"'{path}' holds no ideal weights; make it with 'stationkeep offline --ideal-weights N'"
        ) from None
    if attributes.get("key") != provenance(scenario, KIND, IDEAL_KEY)["key"]:
        raise InputError(
            f"the ideal weights of '{path}' belong to another problem, game, envelope, basis or "
            "[offline]; make them again with 'stationkeep offline --ideal-weights N'"
        )
    states, values, gradients = (
        np.concatenate([parts[name], parts[f"held_out_{name}"]])
        for name in ("zeta", "value", "costate")
    )
    bounds = Bounds(float(epsilon), float(epsilon_prime), len(parts["epsilon"]))
    return Ideal(parts["ideal_weights"], Pairs(states, values, gradients), bounds)


def envelope_states(envelope: Array, n_states: int, seed: int, stream: int) -> Array:
    """Return seeded states envelope · U(-1, 1)^n · U(0.1, 1), shape (N, n).

    The first ones are the same for every N, so a larger set goes on where a smaller one ended; another
    `stream` gives other states.
    """
    uniform = np.random.default_rng([seed, stream]).uniform(size=(n_states, len(envelope) + 1))
    direction, radius = 2.0 * uniform[:, :-1] - 1.0, 0.1 + 0.9 * uniform[:, -1:]
    return np.asarray(envelope * direction * radius)


def require_numbers(scenario: Scenario, n_states: int, held_out: int) -> None:
    """Raise InputError unless there are enough states for the basis, and some held out."""
    basis = scenario.station_keeping().basis
    if n_states < least_states(basis):
        raise InputError(
            f"--ideal-weights is {n_states}, but the {basis.n_basis} weights of basis '{basis.name}' "
            f"take the values and gradients of at least {least_states(basis)} states"
        )
    if held_out < 1:
        raise InputError(f"--held-out is {held_out}, but must be at least 1")


def certified_pairs(optima: Optima, given_up: dict[int, str]) -> tuple[Pairs, list[str]]:
    """Return the values and gradients whose certificate holds, and the faults of the others.

    Raises
    ------
    RunError
        If none is certified.
    """
    kept: list[int] = []
    values, gradients, faults = [], [], []
    for state in range(len(optima.states)):
        if state in given_up:
            faults.append(given_up[state])
            continue
        path = record_path(optima.folder, state)
        attributes, _ = read_parts(path)
        fault = str(attributes.get("failed") or attributes["faults"])
        if fault:
            faults.append(fault)
            continue
        kept.append(state)
        values.append(float(attributes["value"]))
        gradients.append(read_parts(path, "costate")[1]["costate"])
    if not kept:
        raise RunError(f"none of {len(faults)} states is certified, for instance: {faults[0]}")
    return Pairs(optima.states[kept], np.array(values), np.array(gradients)), faults


def fit(setup: Setup, training: Pairs, held_out: Pairs) -> Fit:
    """Fit the weights to the training pairs and measure their errors over the others."""
    found = fit_weights(setup.basis, training)
    epsilon, epsilon_prime = error_sizes(setup.basis, found.weights, held_out)
    _, difference = representation_errors(setup.basis, found.weights, held_out)
    wrong, right = (effort(setup, held_out.states, g) for g in (difference, held_out.gradients))
    policy = ErrorSize.of(wrong, wrong / right)
    return Fit(found.weights, found.norm, epsilon, epsilon_prime, policy)


def effort(setup: Setup, states: Array, gradients: Array) -> Array:
    """Return sqrt(v'R_eff v) of v = -R_eff^-1 g'V_ζ / 2 at states and gradients (N, n), (N,)."""
    plant = Plant(setup.problem)
    g = np.array([plant.terms(state)[1] for state in states])
    push = np.einsum("pnk,pn->pk", g, gradients)
    squared = np.einsum("pk,kl,pl->p", push, setup.game.R_eff_inverse, push)
    return np.asarray(0.5 * np.sqrt(squared))


def ideal_record(scenario: Scenario, found: Fit, training: Pairs, held_out: Pairs) -> xr.Dataset:
    """Return the record of ideal weights: what the learner, `compare` and `check` start from."""
    setup = scenario.station_keeping()
    units = {"units": unit_text(setup.problem.state_units)}
    epsilon, epsilon_prime = representation_errors(setup.basis, found.weights, held_out)
    gradient = {"units": "cost per unit of the state"}
    data: dict[str, Any] = {
        "ideal_weights": ("basis", found.weights, {"units": "cost"}),
        "epsilon": ("held_out", epsilon, {"units": "cost"}),
        "epsilon_prime": (("held_out", "state"), epsilon_prime, gradient),
    }
    for name, pairs in (("sample", training), ("held_out", held_out)):
        prefix = "" if name == "sample" else "held_out_"
        data |= {
            f"{prefix}zeta": ((name, "state"), pairs.states, units),
            f"{prefix}value": (name, pairs.values, {"units": "cost"}),
            f"{prefix}costate": ((name, "state"), pairs.gradients, gradient),
        }
    sizes = {
        f"{name}_{size}": value
        for name in SIZES
        for size, value in asdict(getattr(found, name)).items()
    }
    attributes = {
        **provenance(scenario, KIND, IDEAL_KEY),
        **versions(),
        "basis": setup.basis.name,
        "norm": found.norm,
        **sizes,
    }
    return xr.Dataset(data, {"state": list(setup.problem.state_names)}, attributes)
