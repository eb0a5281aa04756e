"""What every test shares: a compilation cache of its own, no windows, and the reference game."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from stationkeep.symbolic import Game, Model, Problem, Vehicle
from stationkeep.symbolic.compiled import kernel

# words of Python and of libraries that mean nothing to somebody who wrote a TOML file
JARGON = (
    "Traceback",
    "pydantic",
    "[type=",
    "Input should",
    "list[",
    "tuple",
    "dictionary",
    "instance of",
)

# Files that take more than five seconds of processor time, the longest first: processes that share the
# files begin with these, so that none of them is begun when all others are done.
LONGEST_FIRST = (
    *("test_cli_compare", "test_docs", "test_comparison_replay", "test_cli_many_states"),
    *("test_comparison_compare", "test_cli_sweep_faults", "test_cli_sweep", "test_cli_interrupt"),
    *("test_cli_bad_folders", "test_cli_json", "test_examples", "test_comparison_optima"),
    *("test_comparison_scenario", "test_online_record", "test_offline_certificate"),
    *("test_comparison_ideal", "test_cli_gamma", "test_offline_extremals"),
    *("test_symbolic_compilation", "test_comparison_clairvoyant", "test_cli_records"),
    *("test_platforms", "test_main_guard", "test_online_memory", "test_comparison_records"),
    *("test_cli_bad_files", "test_cli_help", "test_comparison_regret", "test_comparison_problem"),
    *("test_comparison_uub", "test_offline_worst_case", "test_comparison_pool"),
    *("test_offline_clairvoyant", "test_offline_saddle", "test_comparison_sweep_table"),
    *("test_comparison_theory", "test_benchmarks", "test_online_closed_loop"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files of `LONGEST_FIRST` first; the order within a file stays."""
    rank = {name: place for place, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: rank.get(item.path.stem, len(rank)))


@pytest.fixture(scope="session", autouse=True)
def isolated_environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """One compilation cache for the whole run, apart from the user's, and plots without a screen.

    Tests that run in parallel share it: what one has compiled the others find.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "compiled"
    folder.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STATIONKEEP_CACHE", str(folder))
        patch.setenv("MPLBACKEND", "Agg")
        yield folder


@pytest.fixture(scope="session")
def reference_scale() -> NDArray[np.float64]:
    """Half-widths of the shipped envelope: m, rad, m/s, rad/s."""
    return np.array([2, 2, 2, 0.4, 0.4, 1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5])


@pytest.fixture(scope="session")
def reference_game() -> Game:
    """The shipped game: Bryson's Q, R that mixes N^-2 and (N m)^-2, W_d = R and gamma = 2."""
    Q = 20.0 / np.array([1, 1, 1, 0.2, 0.2, 0.3, 1, 1, 1, 1, 1, 1]) ** 2
    R = np.array([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])
    return Game(Q, R, R, 2.0)


@pytest.fixture(scope="session")
def reference_problem(reference_game: Game, reference_scale: NDArray[np.float64]) -> Problem:
    """The shipped game on the neutral BlueROV2 Heavy."""
    model = Model(Vehicle.load("bluerov2-heavy"), compiled=False)
    return model.problem(reference_game, reference_scale)


@pytest.fixture(scope="session")
def one_sentence() -> Callable[[BaseException], str]:
    """Return a check that a message is one plain sentence for a user, and hands it back."""

    def check(error: BaseException) -> str:
        text = str(error)
        assert text
        assert text == text.strip()
        assert "\n" not in text, text
        assert len(text) <= 360, text
        for jargon in JARGON:
            assert jargon not in text, text
        return text

    return check


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty compilation cache, and a process that has not yet said anything about compilers."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("STATIONKEEP_CACHE", str(folder))
    monkeypatch.setattr(kernel, "_said", set())
    return folder


@pytest.fixture
def compiler_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Return a function that makes a shell script the C compiler; $out and $source are its files."""

    def install(body: str) -> Path:
        path = tmp_path / "fake-cc"
        path.write_text(
            "#!/bin/sh\n"
            'if [ "$1" = --version ]; then echo "fake cc 1.0"; exit 0; fi\n'
            'for word in "$@"; do\n'
            '  case "$word" in *.c) source="$word";; esac\n'
            '  if [ "$last" = -o ]; then out="$word"; fi\n'
            '  last="$word"\n'
            f"done\n{body}\n",
            encoding="utf-8",
        )
        path.chmod(0o755)
        monkeypatch.setenv("CC", str(path))
        return path

    return install
