"""Good inputs with one or two things wrong, seeded: what users type, and what files suffer."""

from __future__ import annotations

import json
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.records import online_record

VALUES: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3.5, 1e-9, 1e9, 1e308, -1e308, 5e-324, 2**63, 2**70, -0.0),
    *(float("nan"), float("inf"), float("-inf"), True, False, "", "abc", "1", "nan", "ζ", "a" * 5000),
    *([], [1], [1, 2, 3], [[1, 2], [3]], [[]], ["a"], [True], {}, {"a": 1}, [0.0] * 12, [1e9] * 12),
    *([[1.0] * 6] * 6, [[0.0] * 6] * 6, [float("nan")] * 6, "../../etc", "file.py:make", "\x00"),
)
FACTORS = (-1.0, 0.0, 1e-3, 1e3, 1e6, 0.5, 2.0, 9.81, 1.0 / 9.81)
SHORT = (
    *("--set", "simulation.duration=0.1", "--set", "samples.number=10"),
    *("--set", "basis.name=quadratic"),
)
WORDS = ("", "nan", "inf", "1e999", "x", "--", "0x10", "1_0", "3.2", "1,5", "#")
TEXTS = (
    *("", "=", "a=", "=1", "game", "game.=1", ".gamma=1", "game.gamma", "game[0]=1", "a.b.c.d=1"),
    *("game.Q[99]=1", "game.Q[-1]=1", "simulation=3", "game.gamma=1=2", "vehicle=[1]", "\n"),
)
QUIET = ("--quiet", "--json")


def to_toml(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(to_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(key)} = {to_toml(item)}' for key, item in value.items())}}}"
    return repr(value)


class Inputs:
    """Makers of inputs; each returns a name and the words of a command.

    Parameters
    ----------
    folder : where the files are written
    """

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.rng = folder, np.random.default_rng(seed)
        self._scenario = _shipped("comparison/scenario/scenarios/bluerov2-heavy.toml")
        self._vehicle = _shipped("symbolic/underwater/vehicles/bluerov2-heavy.toml")
        self._keys = [*_paths(Scenario.load().model_dump())]
        sets = ["simulation.duration=0.2", "samples.number=10", "basis.name=quadratic"]
        online_record(Scenario.load(overrides=sets), folder / "good.nc")
        self._record = (folder / "good.nc").read_bytes()

    def vehicle(self) -> tuple[str, list[str]]:
        """A vehicle's file, by `check` of the shipped scenario with it."""
        name, text = self._changed(self._vehicle)
        path = self.folder / "vehicle.toml"
        path.write_bytes(text)
        return name, [*self._command(), "--set", f"vehicle={path}", *SHORT]

    def scenario(self) -> tuple[str, list[str]]:
        """A scenario's file."""
        name, text = self._changed(self._scenario)
        path = self.folder / "scenario.toml"
        path.write_bytes(text)
        return name, [*self._command(), str(path), *SHORT]

    def override(self) -> tuple[str, list[str]]:
        """One or two `--set`."""
        texts = [self._set() for _ in range(int(self.rng.integers(1, 3)))]
        words = [*self._command(), *SHORT]
        for text in texts:
            words += ["--set", text]
        return " ".join(texts)[:300], words

    def states(self) -> tuple[str, list[str]]:
        """A file of states, or one on the command line."""
        rows = self.rng.uniform(-0.3, 0.3, (int(self.rng.integers(1, 4)), 12))
        kind = int(self.rng.integers(4))
        if kind == 0:
            text = ",".join(self._word(x) for x in rows[0])
            return f"--state {text}"[:300], self._solve(["--state", text])
        path = self.folder / ("states.npy" if kind == 1 else "states.csv")
        if kind == 1:
            np.save(path, rows)
            content = path.read_bytes()
        else:
            separator = str(self.rng.choice([",", ";", "\t", " ", ", ", ",,"]))
            content = "\n".join(separator.join(self._word(x) for x in row) for row in rows).encode()
        content = self._damaged(content) if self.rng.random() < 0.7 else content
        path.write_bytes(content)
        return f"{path.name} {content[:200]!r}", self._solve(["--states", str(path)])

    def weights(self) -> tuple[str, list[str]]:
        """A record that a learner is to start from."""
        path = self.folder / "weights.nc"
        content = self._damaged(self._record)
        path.write_bytes(content)
        text = f"learner.weights={json.dumps(str(path))}"
        name = f"weights, {len(content)} bytes, {_first_change(self._record, content)}"
        return name, ["online", *SHORT, *QUIET, "--out", str(self.folder / "out"), "--set", text]

    def record(self) -> tuple[str, list[str]]:
        """A record with one bit flipped."""
        content = bytearray(self._record)
        place, bit = int(self.rng.integers(len(content))), int(self.rng.integers(8))
        content[place] ^= 1 << bit
        path = self.folder / "flipped.nc"
        path.write_bytes(content)
        kind = int(self.rng.integers(3))
        words = (
            ["replay", str(path), *QUIET],
            ["check", "--run", str(path), *QUIET],
            ["export", str(path), "--out", str(self.folder / "out.mat"), *QUIET],
        )[kind]
        return f"{words[0]}, byte {place}, bit {bit}", words

    def _command(self) -> list[str]:
        """Return what takes the input: mostly what all commands begin with, at times a whole one."""
        whole = ["check", *QUIET], ["online", *QUIET, "--out", str(self.folder / "out")]
        kind = int(self.rng.integers(12))
        return whole[kind] if kind < len(whole) else ["load"]

    def _solve(self, words: list[str]) -> list[str]:
        if self.rng.random() > 0.05:
            return ["states", *words]
        rough = ("horizon=5", "intervals=4", "aligned=false", "starts=0", "rounds=1", "max_seconds=3")
        words = ["offline", *words, *QUIET, "--workers", "1", "--out", str(self.folder / "out")]
        for text in rough:
            words += ["--set", f"offline.{text}"]
        return words

    def _word(self, number: float) -> str:
        return f"{number:.4g}" if self.rng.random() > 0.03 else str(self.rng.choice(WORDS))

    def _set(self) -> str:
        if self.rng.random() < 0.1:
            return str(self.rng.choice(TEXTS))
        key = self._keys[int(self.rng.integers(len(self._keys)))]
        return f"{key}={to_toml(self._value())}"

    def _value(self) -> Any:
        return VALUES[int(self.rng.integers(len(VALUES)))]

    def _changed(self, good: dict[str, Any]) -> tuple[str, bytes]:
        """Return what was changed in the data of a TOML file, and the file's text."""
        data = json.loads(json.dumps(good))
        names = []
        for _ in range(int(self.rng.integers(1, 3))):
            names.append(self._change(data))
        text = "\n".join(f"{key} = {to_toml(value)}" for key, value in data.items()).encode()
        if self.rng.random() < 0.15:
            text = self._damaged(text)
            names.append("damaged")
        return "; ".join(names)[:300], text

    def _change(self, data: dict[str, Any]) -> str:
        paths = [*_paths(data)]
        path = paths[int(self.rng.integers(len(paths)))]
        *groups, last = path.split(".")
        for group in groups:
            data = data[group]
        how = int(self.rng.integers(4))
        if how == 0:
            del data[last]
            return f"without {path}"
        if how == 1:
            data[last + "_"] = data.pop(last)
            return f"{path} misspelt"
        if how == 2 and isinstance(data[last], (int, float, list)):
            factor = FACTORS[int(self.rng.integers(len(FACTORS)))]
            data[last] = _scaled(data[last], factor)
            return f"{path} times {factor:g}"
        data[last] = self._value()
        return f"{path} = {to_toml(data[last])[:80]}"

    def _damaged(self, content: bytes) -> bytes:
        """Return bytes with some changed, cut off, doubled or inserted."""
        how, rng = int(self.rng.integers(5)), self.rng
        if not content:
            return b"\x00"
        place = int(rng.integers(len(content)))
        if how == 0:
            return content[:place]
        if how == 1:
            return content[:place] + bytes(rng.integers(0, 256, 8, dtype=np.uint8)) + content[place:]
        if how == 2:
            return b"\xef\xbb\xbf" + content
        changed = bytearray(content)
        for _ in range(1 if how == 3 else 20):
            changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
        return bytes(changed)


def _shipped(path: str) -> dict[str, Any]:
    text = resources.files("stationkeep").joinpath(path).read_text(encoding="utf-8")
    return tomllib.loads(text)


def _paths(data: dict[str, Any], above: str = "") -> list[str]:
    found = []
    for key, value in data.items():
        found.append(f"{above}{key}")
        if isinstance(value, dict):
            found += _paths(value, f"{above}{key}.")
    return found


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_scaled(entry, factor) for entry in value]
    return value * factor if isinstance(value, (int, float)) else value


def _first_change(before: bytes, after: bytes) -> str:
    places = (i for i, (a, b) in enumerate(zip(before, after, strict=False)) if a != b)
    return f"first change at {next(places, min(len(before), len(after)))}"
