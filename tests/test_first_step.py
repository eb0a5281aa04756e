"""`generate` builds what a controller needs, and a controller is built before its first step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from stationkeep.comparison import Scenario
from stationkeep.comparison.scenario import generate
from stationkeep.online import Controller
from stationkeep.online.vector import compiled
from stationkeep.symbolic.compiled import compilation

from .games import QUICK

ETA, ETA_DOT = [0.4, -0.2, 0.3, 0.08, -0.05, 0.2], [0.05, -0.02, 0.03, 0.02, -0.04, 0.06]
FIXED = ("learner.error=bellman", "learner.rule=gradient", "learner.safeguard=false")


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Keys of the libraries that are asked for, in order, in a process that has none yet."""
    keys: list[str] = []
    key: Callable[..., str] = compilation._key

    def noted(*arguments: object) -> str:
        keys.append(key(*arguments))
        return keys[-1]

    monkeypatch.setattr(compilation, "_key", noted)
    compiled._library.cache_clear()
    return keys


@pytest.mark.parametrize("settings", [(), FIXED, ("samples.remember=true", "samples.paths=2")])
def test_a_controller_needs_nothing_that_generate_has_not_built(
    settings: tuple[str, ...], asked: list[str]
) -> None:
    scenario = [*QUICK, *settings]
    made = generate(Scenario.load("bluerov2-heavy", scenario))
    built = set(asked)
    assert len(made.functions) == len({function.name for function in made.functions})
    asked.clear()
    compiled._library.cache_clear()
    controller = Controller(Scenario.load("bluerov2-heavy", scenario))
    assert len(asked) > 3
    assert set(asked) <= built
    asked.clear()
    for i in range(3):
        assert np.isfinite(controller.step(ETA, ETA_DOT, 0.25)).all()
        assert controller.last_step is not None, i
    assert not asked


def test_frozen_weights_need_no_predictions(asked: list[str]) -> None:
    generate(Scenario.load("bluerov2-heavy", [*QUICK]))
    built = len(set(asked))
    asked.clear()
    Controller(Scenario.load("bluerov2-heavy", [*QUICK]), learn=False).step(ETA, ETA_DOT, 0.02)
    assert len(set(asked)) < built
