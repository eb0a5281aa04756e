"""A problem as data: its equations as lists of instructions, its weights as numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import casadi
import numpy as np
from casadi import SX

from ..arrays import Array
from ..errors import InputError
from ..expressions import from_data, to_data
from .angles import Equivalence
from .checks import InverseDynamics
from .domain import Bound
from .game import Game
from .problem import Problem

NAMES = ("state_names", "state_units", "input_names", "input_units")


def problem_to_data(problem: Problem) -> dict[str, Any]:
    """Return a problem as what JSON can hold; `problem_from_data` gives the very same back.

    All its equations are one function, so that nodes which they share stay shared.
    """
    game, inverse = problem.game, problem.inverse_dynamics
    parts = {"drift": problem.drift, "control_matrix": problem.control_matrix}
    if not problem.same_inputs:
        parts["disturbance_matrix"] = problem.disturbance_matrix
    parts["switching"] = problem.switching
    for i, bound in enumerate(problem.domain):
        parts[f"margin_{i}"] = bound.margin
        parts[f"shown_{i}"] = bound.margin if bound.shown is None else bound.shown
    inputs = {"zeta": problem.zeta}
    if inverse is not None:
        inputs["acceleration"], parts["inverse"] = inverse.acceleration, inverse.v
    equations = casadi.Function("equations", [*inputs.values()], [*parts.values()], [*inputs], [*parts])
    weights = {name: getattr(game, name).tolist() for name in ("Q", "R", "W_d")}
    return {
        "name": problem.name,
        "scale": problem.scale.tolist(),
        **{name: list(getattr(problem, name)) for name in NAMES},
        "game": weights | {"gamma": game.gamma if np.isfinite(game.gamma) else None},
        "domain": [bound.sentence for bound in problem.domain],
        "equations": to_data(equations),
    } | _angles_to_data(problem)


def problem_from_data(data: Mapping[str, Any]) -> Problem:
    """Return the problem of `problem_to_data`.

    Raises
    ------
    InputError
        If the data are not those of a problem.
    """
    try:
        equations = from_data(data["equations"])
        names = [equations.name_in(i) for i in range(equations.n_in())]
        symbols = [SX.sym(name, *equations.size_in(i)) for i, name in enumerate(names)]
        results = equations.call(symbols)
        parts = {equations.name_out(i): result for i, result in enumerate(results)}
        given, weights = dict(zip(names, symbols, strict=True)), data["game"]
        gamma = np.inf if weights["gamma"] is None else float(_matrix(weights["gamma"]))
        inverse = None
        if "acceleration" in given:
            inverse = InverseDynamics(given["acceleration"], parts["inverse"])
        domain = tuple(
            Bound(parts[f"margin_{i}"], str(sentence), parts[f"shown_{i}"])
            for i, sentence in enumerate(data["domain"])
        )
        return Problem(
            name=str(data["name"]),
            zeta=given["zeta"],
            drift=parts["drift"],
            control_matrix=parts["control_matrix"],
            disturbance_matrix=parts.get("disturbance_matrix", parts["control_matrix"]),
            game=Game(**{name: _matrix(weights[name]) for name in ("Q", "R", "W_d")}, gamma=gamma),
            scale=_matrix(data["scale"]),
            domain=domain,
            switching=parts["switching"],
            inverse_dynamics=inverse,
            **_names_and_angles(data),
        )
    except (KeyError, TypeError, IndexError) as error:
        raise InputError(f"these are not the data of a problem ({error!r}); make them again") from None


def _angles_to_data(problem: Problem) -> dict[str, Any]:
    """Return what a problem says of its angles; nothing where it has none."""
    said: dict[str, Any] = {"periods": list(problem.periods)} if problem.periods else {}
    if problem.equivalence is not None:
        said["equivalence"] = asdict(problem.equivalence)
    return said


def _names_and_angles(data: Mapping[str, Any]) -> dict[str, Any]:
    said: dict[str, Any] = {name: tuple(map(str, data[name])) for name in NAMES}
    said["periods"] = tuple(_matrix(data.get("periods", [])).ravel().tolist())
    if "equivalence" in data:
        second = data["equivalence"]
        signs, shift = (tuple(_matrix(second[name]).ravel().tolist()) for name in ("signs", "shift"))
        limit = float(_matrix(second["limit"]))
        said["equivalence"] = Equivalence(int(second["state"]), limit, signs, shift)
    return said


def _matrix(values: Any) -> Array:
    try:
        return np.array(values, dtype=np.float64)
    except (ValueError, TypeError):
        raise InputError("the data of a problem hold a matrix that is none; make them again") from None
