"""The part of `stationkeep offline` that fits ideal weights to certified optima over the envelope."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..comparison import Scenario
from ..comparison.optima import (
    HELD_OUT,
    SIZES,
    TRAINING,
    Optima,
    certified_pairs,
    envelope_states,
    fit,
    ideal_record,
    require_numbers,
)
from ..offline import Pairs
from ..online import save
from ..symbolic import InputError
from .output import print_table
from .solving import solve

LABELS = {
    "epsilon": "ε = V - W'σ [cost]",
    "epsilon_prime": "ε' = V_ζ - σ''W [cost per unit]",
    "policy": "policy v, norm of R_eff [sqrt(cost/s)]",
}


@dataclass(frozen=True)
class Numbers:
    """How many states are sampled for the fit, and how many held out."""

    n_states: int
    held_out: int


def numbers(options: argparse.Namespace, scenario: Scenario) -> Numbers | None:
    """Return what --ideal-weights and --held-out ask for, None for no fit; raises InputError."""
    n_states: int | None = options.ideal_weights
    if n_states is None:
        if options.held_out is not None:
            raise InputError(
                f"--held-out {options.held_out} goes with --ideal-weights N, which is missing; add it"
            )
        return None
    held_out = max(10, n_states // 4) if options.held_out is None else options.held_out
    require_numbers(scenario, n_states, held_out)
    return Numbers(n_states, held_out)


def ideal_weights(
    options: argparse.Namespace, scenario: Scenario, folder: Path, asked: Numbers
) -> dict[str, Any]:
    """Sample, solve, fit, write `ideal-weights.nc`, and return what is told of it."""
    faults: list[str] = []

    def pairs(n: int, stream: int, name: str) -> Pairs:
        envelope, seed = scenario.station_keeping().envelope, scenario.simulation.seed
        states = envelope_states(envelope, n, seed, stream)
        optima = Optima(scenario, states, folder / "ideal-weights" / name)
        given_up = solve(options, optima, f"{name} states")
        found, missing = certified_pairs(optima, given_up)
        faults.extend(missing)
        return found

    training = pairs(asked.n_states, TRAINING, "training")
    held_out = pairs(asked.held_out, HELD_OUT, "held-out")
    found = fit(scenario.station_keeping(), training, held_out)
    path = save(ideal_record(scenario, found, training, held_out), folder / "ideal-weights.nc")
    return {
        "n_states": len(training.values),
        "held_out": len(held_out.values),
        "basis": scenario.basis.name,
        "n_basis": len(found.weights),
        "norm": found.norm,
        **{name: asdict(getattr(found, name)) for name in SIZES},
        "faults": faults,
        "file": path,
    }


def show(answer: dict[str, Any]) -> None:
    """Print the table of the errors."""
    sizes: Sequence[str] = ("sup", "rms", "sup_relative", "rms_relative")
    print_table(
        f"Ideal weights of the {answer['n_basis']} functions of basis '{answer['basis']}', fitted to "
        f"{answer['n_states']} states; errors over {answer['held_out']} others",
        ["error of", "sup", "rms", "sup, relative", "rms, relative"],
        [[label, *(f"{answer[name][s]:.3g}" for s in sizes)] for name, label in LABELS.items()],
    )
    if answer["faults"]:
        print(f"{len(answer['faults'])} states left out, the first: {answer['faults'][0]}")
    print(f'learner.weights = "{answer["file"]}" starts from them')
