"""A scenario: the one input of the online run and of the offline optimum."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, PrivateAttr

from ...offline import OfflineSettings
from ...online import LearnerSettings, SampleSettings, SimulationSettings, load_weights
from ...symbolic import (
    Basis,
    Game,
    GammaTooSmallError,
    InputError,
    Model,
    Problem,
    StationKeeping,
    Vehicle,
    find_function,
    gamma_star,
    require_vehicle_state,
)
from ...symbolic.arrays import Array, Vector3
from ...symbolic.game import weight_matrix
from ...symbolic.toml import Settings, locate, read_toml, shipped_names, validate
from ...symbolic.underwater import STATE_NAMES
from ...symbolic.value import BasisFunction
from .files import Files
from .overrides import override, replace_value
from .settings import BasisSettings, EnvelopeSettings, GameSettings

Restore = Callable[[str, Path | None, Files], "Scenario"]
DEFAULT = "bluerov2-heavy"
STATION = {"vehicle", "vehicle_parameters", "current", "game", "envelope", "basis"}


class Scenario(Settings):
    """Vehicle, game, envelope, basis, learner, samples, simulation and offline solve.

    Attributes
    ----------
    vehicle : a shipped name or the path of a TOML file
    vehicle_parameters : parameters that replace those of the vehicle's file
    current : known steady current in the earth frame [m/s], balanced by the trim
    """

    vehicle: str
    vehicle_parameters: dict[str, Any] = Field(default_factory=dict)
    current: Vector3 = (0.0, 0.0, 0.0)
    game: GameSettings
    envelope: EnvelopeSettings
    basis: BasisSettings = BasisSettings()
    learner: LearnerSettings = LearnerSettings()
    samples: SampleSettings = SampleSettings()
    simulation: SimulationSettings
    offline: OfflineSettings = OfflineSettings()

    _folder: Path | None = PrivateAttr(default=None)
    _files: Files = PrivateAttr(default_factory=Files)

    @classmethod
    def load(cls, name: str | Path = DEFAULT, overrides: Sequence[str] = ()) -> Scenario:
        """Load a shipped scenario by name, or a user's by the path of its TOML file.

        Parameters
        ----------
        overrides : "section.key=value" settings, values written as in TOML

        Raises
        ------
        InputError
            If there is no such scenario or it breaks a rule; one sentence says which.
        """
        path = locate(name, __package__, "scenarios", "scenario")
        data = read_toml(path)
        for text in overrides:
            override(data, text)
        scenario = validate(cls, data, f"scenario '{name}'")
        scenario._folder = path.parent
        scenario._require_start()
        return scenario

    @staticmethod
    def shipped() -> list[str]:
        """Return the names of the shipped scenarios."""
        return shipped_names(str(__package__), "scenarios")

    def with_settings(self, **groups: dict[str, Any]) -> Scenario:
        """Return a copy with keys of some groups replaced: `with_settings(samples={"number": 0})`.

        What doesn't depend on the changed groups is compiled once for both.
        """
        data = self.model_dump()
        for group, keys in groups.items():
            data[group] |= keys
        changed = validate(Scenario, data, "scenario")
        changed._folder, changed._files = self._folder, self._files.without(groups)
        if not STATION & set(groups):
            changed.use_station(self._station_keeping)
        return changed

    def with_values(self, values: Mapping[str, Any], where: str = "scenario") -> Scenario:
        """Return a copy with "section.key" or "section.key[i]" replaced, nothing compiled yet.

        Raises
        ------
        InputError
            If there is no such key or entry, or the value breaks a rule.
        """
        data = self.model_dump()
        for key, value in values.items():
            replace_value(data, key, value, where)
        changed = validate(Scenario, data, where)
        changed._folder = self._folder
        return changed

    def station_text(self) -> str:
        """Return the settings that `station_keeping` depends on, as JSON."""
        return self.model_dump_json(include=STATION)

    def use_station(self, station: StationKeeping) -> None:
        """Take what another scenario with the same `station_text` has built."""
        self.__dict__["_station_keeping"] = station

    def __reduce__(self) -> tuple[Restore, tuple[str, Path | None, Files]]:
        """Pickle as JSON, the scenario's folder and files: what is compiled can't be pickled."""
        return restored, (self.model_dump_json(), self._folder, self._files)

    def station_keeping(self) -> StationKeeping:
        """Return vehicle, game and basis, compiled when first used; built once a scenario.

        Raises
        ------
        InputError
            If the vehicle, the game or the basis breaks a rule; γ too small names γ*.
        """
        return self._station_keeping

    def initial_weights(self) -> Array | None:
        """Return the learner's initial weights, or None for `weight_factor` times the Riccati weights.

        Raises
        ------
        InputError
            If the file of weights is not a record with as many weights as the basis, or the vehicle
            whose Riccati solution is asked for breaks a rule.
        """
        if self._files.weights is not None:
            return self._files.weights
        learner = self.learner
        if learner.weights_vehicle is not None:
            return self._riccati_weights(learner.weights_vehicle) * learner.weight_factor
        if learner.weights == "riccati":
            return None
        path = self._path(learner.weights)
        weights = load_weights(path) * learner.weight_factor
        n_basis = self._station_keeping.basis.n_basis
        if weights.shape != (n_basis,):
            raise InputError(
                f"'{path}' holds {weights.size} weights, but basis '{self.basis.name}' has {n_basis}; "
                "use the record of a run with the same basis"
            )
        return weights

    def _riccati_weights(self, vehicle: str) -> Array:
        """Return W with W'σ(ζ) = ζ'P ζ for the P of this game on another vehicle, shape (m,)."""
        station = self._station_keeping
        model = Model(self._load_vehicle(vehicle), self.current)
        return station.basis.quadratic_weights(self._problem(model, station.half_widths).P)

    def plant_vehicle(self) -> Vehicle | None:
        """Return the vehicle that is driven where it is not the scenario's own, else None.

        Raises
        ------
        InputError
            If there is no such vehicle or its file breaks a rule.
        """
        name, changes = self.simulation.plant, self.simulation.plant_parameters
        if name is None:
            return self.model_vehicle().replaced(changes, "the plant") if changes else None
        return self._load_vehicle(name).replaced(changes, f"vehicle '{name}'")

    def model_vehicle(self) -> Vehicle:
        """Return the vehicle that the policies are made for; raises as `plant_vehicle`."""
        return self._load_vehicle(self.vehicle).replaced(
            self.vehicle_parameters, f"vehicle '{self.vehicle}'"
        )

    def file_contents(self) -> list[str]:
        """Return what is in the user's files of a basis and of initial weights, hexadecimal."""
        name, separator, _ = self.basis.name.rpartition(":")
        paths = [self._path(name)] if separator else []
        if self.learner.weights != "riccati":
            paths.append(self._path(self.learner.weights))
        return [path.read_bytes().hex() for path in paths if path.is_file()]

    def basis_function(self) -> BasisFunction:
        """Return σ as a function of the scaled state; raises InputError if it can't be found."""
        if self.basis.name in self._files.bases:
            return self._files.bases[self.basis.name]
        name, separator, function = self.basis.name.rpartition(":")
        return find_function(f"{self._path(name)}:{function}" if separator else function)

    @property
    def initial_state(self) -> Array:
        """ζ(0), shape (12,)."""
        return np.array(self.simulation.initial_state)

    @cached_property
    def _station_keeping(self) -> StationKeeping:
        model = Model(self.model_vehicle(), self.current)
        half_widths = np.array(self.envelope.half_widths)
        problem = self._problem(model, half_widths)
        _ = problem.P  # refuses a gamma without stabilising solution
        basis = Basis.build(self.basis.name, self.basis_function(), problem.zeta, half_widths)
        return StationKeeping(
            problem=problem,
            basis=basis,
            envelope=self.envelope.scale * half_widths,
            compiled=model.compiled,
            model=model,
        )

    def _require_start(self) -> None:
        state, simulation = require_vehicle_state(self.simulation.initial_state), self.simulation
        far = np.abs(state) / np.array(self.envelope.half_widths)
        if far.max() > simulation.chi:
            name = STATE_NAMES[int(far.argmax())]
            raise InputError(
                f"the initial state's {name} is {far.max():.2f} half-widths of the "
                f"envelope, but a run ends beyond chi = {simulation.chi:g}; start closer or raise "
                "simulation.chi"
            )
        if abs(np.degrees(state[4])) > simulation.pitch_limit:
            raise InputError(
                f"the initial state's pitch is {np.degrees(state[4]):.1f} deg, but a run ends beyond "
                f"{simulation.pitch_limit:g} deg; start closer to level or raise simulation.pitch_limit"
            )

    def _load_vehicle(self, name: str) -> Vehicle:
        if name in self._files.vehicles:
            return self._files.vehicles[name]
        named = "/" not in name and not name.endswith(".toml")
        return Vehicle.load(name if named else self._path(name))

    def _problem(self, model: Model, half_widths: Array) -> Problem:
        settings = self.game
        W_d = settings.R if isinstance(settings.W_d, str) else settings.W_d
        weights = {"Q": settings.Q, "R": settings.R, "W_d": W_d}
        huge = Game(
            **{name: weight_matrix(name, value) for name, value in weights.items()}, gamma=np.inf
        )
        problem = model.problem(huge, half_widths)
        try:
            return problem.with_game(Game(huge.Q, huge.R, huge.W_d, settings.gamma))
        except GammaTooSmallError as error:
            star = gamma_star(*problem.linearization, huge.Q, huge.R, huge.W_d)
            raise GammaTooSmallError(settings.gamma, error.threshold, star) from None

    def _path(self, text: str) -> Path:
        """Resolve a path in the scenario: absolute, or relative to the working or its own folder."""
        path = Path(text).expanduser()
        if path.is_absolute() or path.exists() or self._folder is None:
            return path
        beside = self._folder / path
        return beside if beside.exists() else path


def restored(text: str, folder: Path | None, files: Files) -> Scenario:
    """Return the scenario of this JSON; paths may be meant from `folder`, `files` need not be read."""
    scenario = Scenario.model_validate_json(text)
    scenario._folder, scenario._files = folder, files
    return scenario
