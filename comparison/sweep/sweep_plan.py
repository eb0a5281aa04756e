"""Which runs a sweep has: a product of settings, sampled points, initial states and policies.

Runs are numbered with the policy changing fastest, then the state, then the sampled point, then the
settings in the order in which they were given. A run's key says what its numbers depend on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np

from ...online import draw_samples
from ...online.records import versions
from ...symbolic import InputError
from ...symbolic.arrays import Array
from ...symbolic.pyfile import file_content, is_named
from ..policies import contender
from ..records import FORMAT, key_of, model_text
from ..scenario import Scenario
from .vary import Choices, Range, varied

Sampling = Literal["random", "latin", "sobol"]
ROWS = 3  # raise it when the figures of a row, or how they are made, change
FILES = ("vehicle", "problem", "simulation.plant", "basis.name", "learner.weights", "learner.rule")


def sampled(n_points: int, dimension: int, sampling: Sampling, seed: int) -> Array:
    """Return seeded points of the unit cube, shape (N, d), by scipy.stats.qmc.

    Sobol points are the first N of a scrambled sequence; their balance needs N to be a power of two.
    """
    rng = np.random.default_rng(seed)
    if sampling == "random":
        return rng.random((n_points, dimension))
    from scipy.stats import qmc  # takes longer to load than all of ours

    if sampling == "latin":
        return np.asarray(qmc.LatinHypercube(dimension, seed=rng).random(n_points))
    exponent = math.ceil(math.log2(n_points)) if n_points > 1 else 0
    return np.asarray(qmc.Sobol(dimension, seed=rng).random_base2(exponent)[:n_points])


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes
    ----------
    number : from 0
    key : hash of what its numbers depend on
    policy : name of the contender
    state : its initial state's number among those from the same settings, from 0
    settings : what differs from the scenario
    zeta : (n,) initial state; None for the scenario's
    """

    number: int
    key: str
    policy: str
    state: int
    settings: dict[str, Any]
    zeta: tuple[float, ...] | None

    def scenario(self, base: Scenario) -> Scenario:
        """Return the scenario of the run; raises InputError."""
        settings = dict(self.settings)
        if self.zeta is not None:
            settings["simulation.initial_state"] = self.zeta
        return varied(base, settings)


@dataclass(frozen=True, eq=False)
class Plan:
    """All runs of a sweep, each made up when it is asked for.

    Attributes
    ----------
    scenario : what is varied
    policies : names of contenders
    varied : settings that take values or are sampled
    n_points : points at which the ranges are sampled
    sampling : how
    states : (N, n) initial states, or how many are drawn, s x half-widths x U(-1, 1)^n x U(0.1, 1)
        with the envelope of the run; 0 for the scenario's own
    seed : of points and states
    kept : what else the results depend on
    """

    scenario: Scenario
    policies: tuple[str, ...]
    varied: tuple[Choices | Range, ...] = ()
    n_points: int = 0
    sampling: Sampling = "latin"
    states: Array | int = 0
    seed: int = 1
    kept: str = ""

    def __post_init__(self) -> None:
        for name in self.policies:
            contender(name)
        keys = [one.key for one in self.varied]
        twice = {key for key in keys if keys.count(key) > 1}
        if twice:
            raise InputError(f"'{min(twice)}' is varied twice; give all of its values once")
        if len(set(self.policies)) < len(self.policies):
            raise InputError("a policy is named twice; name each once")
        if bool(self.ranges) != bool(self.n_points):
            raise InputError(
                "--samples says at how many points the ranges of --vary section.key=low:high are "
                "sampled; give both or neither"
            )
        here = [key for key in keys if key.startswith("simulation.initial_state")]
        if here and self.drawn_or_given:
            raise InputError(f"both --states and --vary {here[0]} give initial states; choose one")

    @property
    def drawn_or_given(self) -> bool:
        """Whether initial states are not the scenario's own."""
        return not isinstance(self.states, int) or self.states > 0

    @property
    def choices(self) -> tuple[Choices, ...]:
        """Settings that take each of their values."""
        return tuple(one for one in self.varied if isinstance(one, Choices))

    @property
    def ranges(self) -> tuple[Range, ...]:
        """Settings that are sampled."""
        return tuple(one for one in self.varied if isinstance(one, Range))

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values of each choice, of points, states and policies."""
        n_states = self.states if isinstance(self.states, int) else len(self.states)
        sizes = [len(choice.values) for choice in self.choices]
        return (*sizes, max(self.n_points, 1), max(n_states, 1), len(self.policies))

    def __len__(self) -> int:
        return math.prod(self.shape)

    @cached_property
    def points(self) -> Array:
        """(N, d) points of the unit cube."""
        if not self.ranges:
            return np.zeros((1, 0))
        return sampled(self.n_points, len(self.ranges), self.sampling, self.seed)

    def run(self, number: int) -> Run:
        """Return a run by its number."""
        *chosen, point, state, policy = (int(i) for i in np.unravel_index(number, self.shape))
        settings: dict[str, Any] = {
            choice.key: choice.values[i] for choice, i in zip(self.choices, chosen, strict=True)
        }
        units = self.points[point]
        settings |= {one.key: one.at(float(u)) for one, u in zip(self.ranges, units, strict=True)}
        zeta = self._state(settings, state)
        name = self.policies[policy]
        return Run(number, self._key(name, settings, zeta), name, state, settings, zeta)

    def _state(self, settings: dict[str, Any], state: int) -> tuple[float, ...] | None:
        if not isinstance(self.states, int):
            return tuple(self.states[state].tolist())
        if not self.drawn_or_given:
            return None
        envelope = {key: value for key, value in settings.items() if key.startswith("envelope.")}
        return tuple(self._drawn(json.dumps(envelope), self.states)[state].tolist())

    @cached_property
    def _drawn(self) -> Callable[[str, int], Array]:
        @lru_cache(maxsize=4)
        def drawn(envelope: str, n_states: int) -> Array:
            settings = varied(self.scenario, json.loads(envelope)).envelope
            given = settings.half_widths
            widths = self.scenario.setup().half_widths if given is None else np.array(given)
            half_widths = settings.scale * widths
            return draw_samples(half_widths, n_states, self.seed)

        return drawn

    def _key(self, policy: str, settings: dict[str, Any], zeta: tuple[float, ...] | None) -> str:
        named = {name: settings[name] for name in FILES if name in settings}
        parts = [self._sources(json.dumps(named)), policy, json.dumps([settings, zeta], sort_keys=True)]
        if is_named(policy):
            parts.append(file_content(policy))
        return key_of(*parts)[:24]

    @cached_property
    def _sources(self) -> Callable[[str], str]:
        @lru_cache(maxsize=64)
        def sources(named: str) -> str:
            """Return the hash of what every run depends on, with the files that settings name."""
            one = varied(self.scenario, json.loads(named))
            driven = one.plant_vehicle()
            parts = [f"{FORMAT}, rows {ROWS}", repr(sorted(versions().items())), self.kept]
            vehicle = one.problem is None
            model = one.model_vehicle().model_dump_json() if vehicle else model_text(one.setup())
            parts += [self.scenario.model_dump_json(), model]
            parts += ["" if driven is None else driven.model_dump_json(), *one.file_contents()]
            return key_of(*parts)

        return sources
