"""Which keys of a scenario go together, and where a run may start."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel

from ...online import DisturbanceSettings, LearnerSettings, SimulationSettings
from ...symbolic import InputError
from ...symbolic.arrays import Array
from .overrides import key_in

VEHICLE_NEEDS = (
    *(("game", key) for key in ("Q", "R", "gamma")),
    *(("envelope", "half_widths"), ("simulation", "initial_state")),
)
VEHICLE_ONLY = {  # by group
    "": ("vehicle_parameters", "current"),
    "game": ("Q", "R", "W_d"),
    "simulation": (
        *("pitch_limit", "plant", "plant_parameters", "thruster_limits", "noise"),
        *("observer_bandwidth", "disturbance"),
    ),
    "learner": ("weights_vehicle",),
}


def require_keys(scenario: BaseModel, problem: str | None) -> None:
    """Raise ValueError where a vehicle's scenario lacks a key, or a problem's has one for vehicles."""
    if problem is None:
        for group, key in VEHICLE_NEEDS:
            if getattr(getattr(scenario, group), key) is None:
                missing = f"{group}.{key}" if group in scenario.model_fields_set else group
                raise ValueError(f"the key '{missing}' is required and missing; add it")
        return
    unused = next(_vehicle_only(scenario), None)
    if unused is not None:
        raise ValueError(
            f"'{unused}' is for a vehicle, but the scenario is of the problem '{problem}'; leave it out"
        )


def _vehicle_only(scenario: BaseModel) -> Iterator[str]:
    """Yield the keys of a scenario, away from their defaults, that only a vehicle has a use for."""
    for group, keys in VEHICLE_ONLY.items():
        holder = getattr(scenario, group) if group else scenario
        for key in keys:
            if not _is_default(holder, key):
                yield f"{group}.{key}" if group else key
    if getattr(scenario, "simulation").mode == "disturbed":  # noqa: B009 - any scenario
        yield "simulation.mode=disturbed"


def _is_default(group: BaseModel, key: str) -> bool:
    default = type(group).model_fields[key].get_default(call_default_factory=True)
    return bool(getattr(group, key) == default)


def require_used(
    disturbance: DisturbanceSettings,
    learner: LearnerSettings,
    given: Collection[str],
    overrides: Sequence[str],
    varied: Sequence[str],
) -> None:
    """Raise InputError where a key away from its default is given that its group's kind doesn't use.

    Parameters
    ----------
    given : keys of the scenario's file and of the overrides
    overrides : "section.key=value"; where they choose the kind, the file's keys of another may stay
    varied : "section.key=..." of keys that get other values later, so that nothing is chosen yet
    """
    asked, later = ({key_in(text) for text in texts} for texts in (overrides, varied))
    for group, settings in (("simulation.disturbance", disturbance), ("learner", learner)):
        for choice, unused in settings.unused().items():
            chooser = f"{group}.{choice}"
            held = () if chooser in later else asked if chooser in asked else given
            away = (key for key in unused if not _is_default(settings, key))
            found = min((key for key in away if f"{group}.{key}" in held), default=None)
            if found is not None:
                raise InputError(
                    f"'{group}.{found}' is given, but {choice} = '{getattr(settings, choice)}' has no "
                    f"use for it; leave it out, or choose another {choice}"
                )


def require_one_each(key: str, given: Sequence[float], name: str, n_states: int) -> None:
    """Raise InputError unless a setting has one number for each state of `name`."""
    if len(given) != n_states:
        raise InputError(
            f"{key} has {len(given)} numbers, but {name} has {n_states} states; give one for each"
        )


def require_start(
    simulation: SimulationSettings,
    state: Array,
    names: Sequence[str],
    half_widths: ArrayLike,
    periods: Sequence[float],
) -> None:
    """Raise InputError where a run would end at its start, beyond χ."""
    far = np.abs(state) / np.asarray(half_widths)
    if far.max() > simulation.chi:
        farthest = int(far.argmax())
        is_turn = np.isclose(periods[farthest], 2.0 * np.pi)
        hint = "; angles are in rad" if is_turn else ""
        raise InputError(
            f"the initial state's {names[farthest]} is {far.max():.2f} half-widths of the envelope, "
            f"but a run ends beyond chi = {simulation.chi:g}{hint}; start closer or raise "
            "simulation.chi"
        )


def require_level(simulation: SimulationSettings, pitch: float) -> None:
    """Raise InputError where a vehicle's pitch [rad] is beyond the limit of a run."""
    if abs(np.degrees(pitch)) > simulation.pitch_limit:
        raise InputError(
            f"the initial state's pitch is {np.degrees(pitch):.1f} deg, but a run ends beyond "
            f"{simulation.pitch_limit:g} deg; start closer to level or raise simulation.pitch_limit"
        )
