"""The compiled functions of a scenario: built, compared with their source, and copied as C."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...online import Learner
from ...online.laws import Gradient
from ...online.learning import RULES
from ...online.records import write_text
from ...symbolic import Export, InputError, Model, Setup, StationKeeping
from ...symbolic.compiled import cache_folder
from .scenario import Scenario


@dataclass(frozen=True)
class Generated:
    """What became of every function.

    Attributes
    ----------
    functions : name, arguments, operations and largest difference of compiled and symbolic of each
    cache_hit : whether all of them were compiled before
    """

    functions: list[Export]

    @property
    def cache_hit(self) -> bool:
        """Whether all were compiled before."""
        return all(function.cache_hit for function in self.functions)


def generate(
    scenario: Scenario | str,
    out: Path | str | None = None,
    *,
    compiled: bool = True,
    progress: Callable[[int], None] | None = None,
) -> Generated:
    """Generate, compile and verify f, g, their Jacobians, the basis, policies and what learning needs.

    That are the sample kernel and the predictions; the learner's vector code is compiled beside them. A
    controller of the scenario then compiles nothing.

    Parameters
    ----------
    scenario : a scenario, or what `Scenario.load` takes
    out : folder for the C code of every compiled function; nothing is copied if None
    compiled : False uses CasADi's virtual machine even where a C compiler exists
    progress : called with the number of functions that are done

    Raises
    ------
    InputError
        If the scenario breaks a rule, or the folder can't be written.
    """
    one = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
    functions: list[Export] = []
    for described in _exports(one, _rebuilt(one.setup(), compiled)):
        functions.append(described)
        if progress is not None:
            progress(len(functions))
    if out is not None:
        _copy_sources(functions, Path(out))
    return Generated(functions)


def _exports(scenario: Scenario, setup: Setup) -> Iterator[Export]:
    """Build every function of a scenario and yield what became of it."""
    yield from setup.exports(max(scenario.samples.number, 1))
    settings, reference = scenario.learner, setup.riccati_weights
    none = np.zeros((0, setup.problem.n_states))
    learner = Learner(
        setup.problem,
        setup.basis,
        settings,
        none,
        reference,
        functions=setup.functions,
        paths=scenario.samples,
        critic=None if settings.rule in RULES else Gradient(),
    )
    yield from map(setup.functions.exported, learner.build())


def _rebuilt(setup: Setup, compiled: bool) -> Setup:
    """Return a setup of which nothing is compiled yet."""
    if not isinstance(setup, StationKeeping):
        return replace(setup, compiled=compiled)
    model = Model(setup.model.vehicle, setup.model.current, compiled=compiled)
    return replace(setup, compiled=compiled, model=model)


def _copy_sources(functions: list[Export], folder: Path) -> None:
    """Write the C code of every compiled function to a folder."""
    for described in functions:
        if described.key is not None:
            source = cache_folder() / described.key / "function.c"
            try:
                text = source.read_text(encoding="utf-8")
            except OSError as error:
                raise InputError(f"'{source}' can't be read ({error.strerror}); run it again") from None
            write_text(folder / f"{described.name}.c", text)
