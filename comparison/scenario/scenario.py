"""A scenario: the one input of the online run and of the offline optimum."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import Field, PrivateAttr, model_validator

from ...offline import OfflineSettings
from ...online import LearnerSettings, SampleSettings, SimulationSettings, load_weights
from ...online.laws import Critic
from ...symbolic import InputError, Model, Setup, StationKeeping, Vehicle, find_function
from ...symbolic.arrays import Array, Vector3
from ...symbolic.game import require_numbers
from ...symbolic.pyfile import file_content
from ...symbolic.toml import Settings, shipped_names, validate
from ...symbolic.underwater import ANGLES, STATE_NAMES, vehicle_initial_state
from ...symbolic.value import BasisFunction
from .building import file_in, find_problem, named_in, problem_setup, vehicle_problem, vehicle_setup
from .defaults import problem_defaults
from .files import Files, read_settings
from .laws import made_law
from .overrides import keys_of, override, replace_value
from .rules import require_keys, require_level, require_one_each, require_start, require_used
from .settings import BasisSettings, EnvelopeSettings, GameSettings

Restore = Callable[[str, Path | None, Files], "Scenario"]
DEFAULT = "bluerov2-heavy"
STATION = {"vehicle", "problem", "vehicle_parameters", "current", "game", "envelope", "basis"}


class Scenario(Settings):
    """A vehicle or a problem, its game, envelope, basis, learner, samples, simulation, offline solve.

    Attributes
    ----------
    vehicle : a shipped name or the path of a TOML file
    problem : "file.py:name" of a `Problem`, or of a function that returns one, in place of a vehicle
    vehicle_parameters : parameters that replace those of the vehicle's file
    current : known steady current in the earth frame [m/s], balanced by the trim
    """

    vehicle: str | None = None
    problem: str | None = None
    vehicle_parameters: dict[str, Any] = Field(default_factory=dict)
    current: Vector3 = (0.0, 0.0, 0.0)
    game: GameSettings = GameSettings()
    envelope: EnvelopeSettings = EnvelopeSettings()
    basis: BasisSettings = BasisSettings()
    learner: LearnerSettings = LearnerSettings()
    samples: SampleSettings = SampleSettings()
    simulation: SimulationSettings = SimulationSettings()
    offline: OfflineSettings = OfflineSettings()

    _folder: Path | None = PrivateAttr(default=None)
    _files: Files = PrivateAttr(default_factory=Files)

    @model_validator(mode="after")
    def _one_plant(self) -> Scenario:
        if self.vehicle is None and self.problem is None:
            raise ValueError("the key 'vehicle' is required and missing; add it, or a 'problem'")
        if self.vehicle is not None and self.problem is not None:
            raise ValueError("both 'vehicle' and 'problem' are given; give one of the two")
        require_keys(self, self.problem)
        return self

    @classmethod
    def load(
        cls, name: str | Path = DEFAULT, overrides: Sequence[str] = (), varied: Sequence[str] = ()
    ) -> Scenario:
        """Load a shipped scenario by name, a user's by its TOML file, or a problem by "file.py:name".

        Parameters
        ----------
        overrides : "section.key=value" settings, values written as in TOML
        varied : settings that get other values later, "section.key=..."; a key that is of use only
            then is not refused

        Raises
        ------
        InputError
            If there is no such scenario or it breaks a rule; one sentence says which.
        """
        data, folder = read_settings(name)
        for text in overrides:
            override(data, text)
        given = keys_of(data)
        files = Files()
        if isinstance(data.get("problem"), str):
            problem = find_problem(named_in(folder, data["problem"]))
            files = Files(problems={data["problem"]: problem})
            for group, keys in problem_defaults(problem).items():
                if isinstance(data.get(group, {}), dict):
                    data[group] = keys | data.get(group, {})
        scenario = validate(cls, data, f"scenario '{name}'")
        scenario._folder, scenario._files = folder, files
        require_used(scenario.simulation.disturbance, scenario.learner, given, overrides, varied)
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
            changed.use_setup(self._setup)
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
        changed._folder, changed._files = self._folder, Files(problems=self._files.problems)
        return changed

    def setup_text(self) -> str:
        """Return the settings that `setup` depends on, as JSON."""
        return self.model_dump_json(include=STATION)

    def use_setup(self, setup: Setup) -> None:
        """Take what another scenario with the same `setup_text` has built."""
        self.__dict__["_setup"] = setup

    def __reduce__(self) -> tuple[Restore, tuple[str, Path | None, Files]]:
        """Pickle as JSON, the scenario's folder and files: what is compiled can't be pickled."""
        files = replace(self._files, problems={})  # an expression can't be pickled
        return restored, (self.model_dump_json(), self._folder, files)

    def setup(self) -> Setup:
        """Return problem, basis and envelope, compiled when first used; built once a scenario.

        Raises
        ------
        InputError
            If the vehicle, the problem, the game or the basis breaks a rule; γ too small names γ*.
        """
        return self._setup

    def station_keeping(self) -> StationKeeping:
        """Return the setup of a vehicle's scenario; raises InputError for that of another problem."""
        setup = self._setup
        if not isinstance(setup, StationKeeping):
            raise InputError(
                f"this needs a vehicle, but the scenario is of the problem '{self.problem}'; give a "
                "scenario of a vehicle"
            )
        return setup

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
        n_basis = self._setup.basis.n_basis
        if weights.shape != (n_basis,):
            raise InputError(
                f"'{path}' holds {weights.size} weights, but basis '{self.basis.name}' has {n_basis}; "
                "use the record of a run with the same basis"
            )
        return weights

    def _riccati_weights(self, vehicle: str) -> Array:
        """Return W with W'σ(ζ) = ζ'P ζ for the P of this game on another vehicle, shape (m,)."""
        setup = self._setup
        model = Model(self._load_vehicle(vehicle), self.current)
        return setup.basis.quadratic_weights(vehicle_problem(model, self.game, setup.half_widths).P)

    def plant_vehicle(self) -> Vehicle | None:
        """Return the vehicle that is driven where it is not the scenario's own, else None.

        Raises
        ------
        InputError
            If there is no such vehicle or its file breaks a rule.
        """
        name, changes = self.simulation.plant, self.simulation.plant_parameters
        if self.vehicle is None:
            return None
        if name is None:
            return self.model_vehicle().replaced(changes, "the plant") if changes else None
        return self._load_vehicle(name).replaced(changes, f"vehicle '{name}'")

    def model_vehicle(self) -> Vehicle:
        """Return the vehicle that the policies are made for; raises as `plant_vehicle`."""
        if self.vehicle is None:
            raise InputError(f"the scenario is of the problem '{self.problem}', which has no vehicle")
        return self._load_vehicle(self.vehicle).replaced(
            self.vehicle_parameters, f"vehicle '{self.vehicle}'"
        )

    def file_contents(self) -> list[str]:
        """Return what is in the user's files of problem, basis and initial weights, hexadecimal."""
        named = [text.rpartition(":") for text in (self.problem or "", self.basis.name)]
        paths = [self._path(name) for name, separator, _ in named if separator]
        if self.learner.weights != "riccati":
            paths.append(self._path(self.learner.weights))
        contents = [path.read_bytes().hex() for path in paths if path.is_file()]
        return [*contents, *self.law_content()]

    def law_content(self) -> list[str]:
        """Return what is in the file of a user's critic law, hexadecimal; nothing for a shipped one."""
        rule = self.learner.rule
        return [file_content(named_in(self._folder, rule))] if ":" in rule else []

    def critic_law(self) -> Critic | None:
        """Return a new critic law from a user's file, None for a shipped `rule`; raises InputError."""
        rule = self.learner.rule
        return made_law(named_in(self._folder, rule), self._setup) if ":" in rule else None

    def basis_function(self) -> BasisFunction:
        """Return σ as a function of the scaled state; raises InputError if it can't be found."""
        if self.basis.name in self._files.bases:
            return self._files.bases[self.basis.name]
        return find_function(named_in(self._folder, self.basis.name))

    @property
    def initial_state(self) -> Array:
        """ζ(0), (n,): the settings', or half of the envelope's half-widths; angles the short way."""
        problem, given = self._setup.problem, self.simulation.initial_state
        state = 0.5 * self._setup.envelope if given is None else given
        return problem.angles.start(require_numbers(state, problem.state_names))

    @cached_property
    def _setup(self) -> Setup:
        basis = (self.basis.name, self.basis_function())
        if self.problem is None:
            vehicle = self.model_vehicle()
            return vehicle_setup(vehicle, self.current, self.game, self.envelope, basis)
        found = self._files.problems.get(self.problem)
        problem = find_problem(named_in(self._folder, self.problem)) if found is None else found
        return problem_setup(problem, self.game, self.envelope, basis)

    def _require_start(self) -> None:
        given = self.simulation.initial_state
        if given is None:
            return
        if self.problem is None:
            widths = self.envelope.half_widths or ()
            for key, numbers in (("simulation.initial_state", given), ("envelope.half_widths", widths)):
                require_one_each(key, numbers, f"vehicle '{self.vehicle}'", len(STATE_NAMES))
            state = vehicle_initial_state(given)
            require_start(self.simulation, state, STATE_NAMES, widths, ANGLES.periods)
            require_level(self.simulation, float(state[4]))
        else:
            problem = self._setup.problem
            state, periods = problem.initial_state(given), problem.angles.periods
            require_start(self.simulation, state, problem.state_names, problem.scale, periods)

    def _load_vehicle(self, name: str) -> Vehicle:
        if name in self._files.vehicles:
            return self._files.vehicles[name]
        named = "/" not in name and not name.endswith(".toml")
        return Vehicle.load(name if named else self._path(name))

    def _path(self, text: str) -> Path:
        return file_in(self._folder, text)


def restored(text: str, folder: Path | None, files: Files) -> Scenario:
    """Return the scenario of this JSON; paths may be meant from `folder`, `files` need not be read."""
    scenario = Scenario.model_validate_json(text)
    scenario._folder, scenario._files = folder, files
    return scenario
