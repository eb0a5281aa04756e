"""From settings to what learner and solvers share: a problem, a basis and an envelope."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...symbolic import (
    Basis,
    Game,
    GammaTooSmallError,
    InputError,
    Model,
    Problem,
    Setup,
    StationKeeping,
    Vehicle,
)
from ...symbolic.arrays import Array, Vector3
from ...symbolic.game import gamma_star, weight_matrix
from ...symbolic.pyfile import called, find_attribute
from ...symbolic.underwater import STATE_NAMES
from ...symbolic.value import BasisFunction
from .rules import require_one_each
from .settings import EnvelopeSettings, GameSettings


def find_problem(text: str) -> Problem:
    """Return the problem that 'path/to/file.py:name' names, itself or a function that makes it.

    Raises
    ------
    InputError
        If it can't be found, or is no problem.
    """
    found = find_attribute(text, "the problem")
    if callable(found) and not isinstance(found, Problem):
        found = called(found, text)
    if not isinstance(found, Problem):
        raise InputError(
            f"'{text}' is a {type(found).__name__}, but must be a stationkeep Problem or a function "
            "without arguments that returns one"
        )
    return found


def vehicle_setup(
    vehicle: Vehicle,
    current: Vector3,
    game: GameSettings,
    envelope: EnvelopeSettings,
    basis: tuple[str, BasisFunction],
) -> StationKeeping:
    """Return the setup of a vehicle's game; raises InputError if a part breaks a rule."""
    model = Model(vehicle, current)
    assert envelope.half_widths is not None
    require_one_each("envelope.half_widths", envelope.half_widths, vehicle.name, len(STATE_NAMES))
    half_widths = np.array(envelope.half_widths)
    problem = vehicle_problem(model, game, half_widths)
    _ = problem.P  # refuses a gamma without stabilising solution
    return StationKeeping(
        problem=problem,
        basis=Basis.build(*basis, problem.zeta, half_widths),
        envelope=envelope.scale * half_widths,
        compiled=model.compiled,
        model=model,
    )


def vehicle_problem(model: Model, game: GameSettings, half_widths: Array) -> Problem:
    """Return a vehicle's problem; γ too small names γ*."""
    assert game.Q is not None
    assert game.R is not None
    words = {"R": game.R, "I": [1.0] * len(game.R)}
    W_d = words[game.W_d] if isinstance(game.W_d, str) else game.W_d
    weights = {"Q": game.Q, "R": game.R, "W_d": W_d}
    huge = Game(**{name: weight_matrix(name, value) for name, value in weights.items()}, gamma=np.inf)
    problem = model.problem(huge, half_widths)
    gamma = game.gamma
    assert gamma is not None
    try:
        return problem.with_game(Game(huge.Q, huge.R, huge.W_d, gamma))
    except GammaTooSmallError as error:
        star = gamma_star(*problem.linearization, huge.Q, huge.R, huge.W_d)
        raise GammaTooSmallError(gamma, error.threshold, star) from None


def problem_setup(
    problem: Problem,
    game: GameSettings,
    envelope: EnvelopeSettings,
    basis: tuple[str, BasisFunction],
) -> Setup:
    """Return the setup of a problem, with the level γ and the half-widths that the settings give."""
    if envelope.half_widths is not None:
        require_one_each("envelope.half_widths", envelope.half_widths, problem.name, problem.n_states)
        problem = replace(problem, scale=np.array(envelope.half_widths))
    if game.gamma is not None:
        problem = problem.with_gamma(game.gamma)
    _ = problem.P
    return Setup(
        problem=problem,
        basis=Basis.build(*basis, problem.zeta, problem.scale),
        envelope=envelope.scale * problem.scale,
    )


def file_in(folder: Path | None, text: str) -> Path:
    """Return a scenario's path: absolute, or relative to the working folder or the scenario's own."""
    path = Path(text).expanduser()
    if path.is_absolute() or path.exists() or folder is None:
        return path
    beside = folder / path
    return beside if beside.exists() else path


def named_in(folder: Path | None, text: str) -> str:
    """Return "file.py:name" with the file found as `file_in` does; other names as they are."""
    file, separator, name = text.rpartition(":")
    return f"{file_in(folder, file)}:{name}" if separator else text
