"""The runs of `robustness.py`: which states, disturbances, limits, noise and plants."""

from __future__ import annotations

import argparse
import re
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.offline import QuickValue
from stationkeep.online import draw_samples
from stationkeep.symbolic import Vehicle

from .closed_loops import Run

Array = np.ndarray
REST = np.zeros(12)
SEA = {"kind": "waves", "wave_height": 0.25, "wave_period": 4.0, "depth": 3.0, "wave_heading": 30.0}
ROUGH = SEA | {"wave_height": 0.5, "wave_period": 5.0}
NOISE = {"position": 0.02, "attitude": 0.01, "velocity": 0.02, "rate": 0.01, "seed": 1}
OTHER = "bluerov2-heavy-2024"
POLICIES = ("learned", "linear", "lqr", "mpc", "pid")
SEED = 1000


def current(speed: float, heading: float = 30.0, start: float = 0.0) -> dict[str, Any]:
    """Return a step of a horizontal current [m/s, deg, s]."""
    angle = np.radians(heading)
    velocity = (float(speed * np.cos(angle)), float(speed * np.sin(angle)), 0.0)
    return {"kind": "current", "velocity": velocity, "start": start}


def from_state(state: Array, **changes: Any) -> dict[str, Any]:
    """Return settings of a run from a state."""
    return {"initial_state": tuple(float(entry) for entry in state)} | changes


def start_runs(scenario: Scenario, options: argparse.Namespace) -> tuple[str, list[Run]]:
    """Random states of the whole envelope, in the game and in waves with their own phases."""
    half_widths = scenario.station_keeping().half_widths
    states = draw_samples(half_widths, options.starts, SEED)
    title = (
        f"{len(states)} random starts s x half-widths x U(-1, 1) x U(0.1, 1) at s = 1, "
        f"{options.duration:g} s each; waves Hs 0.25 m, Tp 4 s"
    )
    return title, both_modes(states, options.duration)


def corner_runs(scenario: Scenario, options: argparse.Namespace) -> tuple[str, list[Run]]:
    """The corners of the envelope from which the optimum goes farthest, of 1000 seeded ones."""
    problem = scenario.station_keeping().problem
    signs = np.random.default_rng(SEED).choice([-1.0, 1.0], (1000, 12))
    value = QuickValue(scenario.station_keeping().problem)

    def peak(state: Array) -> float:
        path = value.solution(state).trajectory
        return float(np.abs(path.states / problem.scale).max())

    peaks = np.array([peak(state) for state in signs * problem.scale])
    worst = np.argsort(-peaks)[:64]
    title = (
        f"the 64 of 1000 corners of the envelope from which the optimum goes farthest (its largest "
        f"|state|: median {np.median(peaks):.2f}, max {peaks.max():.2f} half-widths)"
    )
    return title, both_modes(signs[worst] * problem.scale, options.duration)


def both_modes(states: Array, duration: float) -> list[Run]:
    """Return learning runs from states in the game and in waves."""
    runs = []
    for number, state in enumerate(states):
        for mode in ("game", "disturbed"):
            changes = from_state(state, mode=mode, duration=duration)
            if mode == "disturbed":
                changes["disturbance"] = SEA | {"seed": number}
            runs.append(Run({"mode": mode}, "learned", changes))
    return runs


def dissipation_runs(scenario: Scenario, options: argparse.Namespace) -> tuple[str, list[Run]]:
    """Seeded current steps and waves in turn, from rest and from states of the envelope."""
    rng = np.random.default_rng(SEED + 1)
    states = draw_samples(scenario.station_keeping().half_widths, options.runs, SEED + 1)
    runs = []
    for number, state in enumerate(states):
        speed, heading, start = rng.uniform(0.05, 0.3), rng.uniform(0.0, 360.0), rng.uniform(0.0, 5.0)
        height, period = rng.uniform(0.1, 0.5), rng.uniform(3.0, 8.0)
        waves = SEA | {"wave_height": height, "wave_period": period, "wave_heading": heading}
        disturbance = current(speed, heading, start) if number % 2 else waves | {"seed": number}
        rest = number % 4 < 2
        changes = from_state(
            REST if rest else state,
            mode="disturbed",
            duration=30.0,
            disturbance=disturbance,
        )
        labels = {
            "disturbance": "current" if number % 2 else "waves",
            "from": "rest" if rest else "envelope",
        }
        runs += [
            Run({"policy": policy} | labels, policy, changes) for policy in ("learned", "linear", "lqr")
        ]
    title = (
        f"{options.runs} runs of 30 s a policy, half current steps of 0.05 to 0.3 m/s, half JONSWAP "
        "waves of Hs 0.1 to 0.5 m, Tp 3 to 8 s, all headings"
    )
    order = ("learned", "linear", "lqr")
    return title, sorted(runs, key=lambda one: order.index(one.policy))


def current_runs(_: Scenario, __: argparse.Namespace) -> tuple[str, list[Run]]:
    """From rest in steady currents and waves, without and with the disturbance observer."""
    disturbances = {f"current {speed:g} m/s": current(speed) for speed in (0.1, 0.25, 0.5)}
    disturbances |= {"waves Hs 0.25 m": SEA, "waves Hs 0.5 m": ROUGH}
    runs = []
    for name, disturbance in disturbances.items():
        for policy in POLICIES:
            for bandwidth in (0.0, 0.3, 1.0):
                labels = {
                    "disturbance": name,
                    "policy": policy,
                    "observer": f"{bandwidth:g} 1/s" if bandwidth else "",
                }
                changes = {"disturbance": disturbance, "observer_bandwidth": bandwidth}
                changes |= {"mode": "disturbed", "duration": 60.0}
                runs.append(Run(labels, policy, from_state(REST, **changes)))
    return "from rest at the station, 60 s", runs


def weaker(name: str, share: float, folder: Path) -> str:
    """Write a shipped vehicle with that share of its thruster limits; return the file's path."""
    shipped = resources.files("stationkeep.symbolic.underwater").joinpath("vehicles", f"{name}.toml")
    text = shipped.read_text("utf-8")
    thrusters = Vehicle.load(name).thrusters
    assert thrusters is not None
    low, high = (share * limit for limit in thrusters.limits)
    path = folder / f"{name}-{share:g}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(re.sub(r"(?m)^limits = \[[^\]]*\]", f"limits = [{low}, {high}]", text), "utf-8")
    return str(path)


def limit_runs(scenario: Scenario, options: argparse.Namespace) -> tuple[str, list[Run]]:
    """Corners of the envelope in still water, and currents, with ever weaker thrusters."""
    half_widths = scenario.station_keeping().half_widths
    corners = half_widths * np.random.default_rng(SEED + 2).choice([-1.0, 1.0], (10, 12))
    cases = [("corners", n, from_state(corner)) for n, corner in enumerate(corners)]
    cases += [("current 0.25 m/s", 0, from_state(REST, disturbance=current(0.25)))]
    held = from_state(REST, disturbance=current(0.5), observer_bandwidth=1.0)
    cases += [("0.5 m/s, observer", 0, held)]
    folder = options.rows.parent
    limits: dict[str, dict[str, Any]] = {"none": {}}
    for share in (1.0, 0.5, 0.25, 0.125, 0.0625):
        plant = weaker(str(scenario.vehicle), share, folder)
        limits[f"{100.0 * share:g} %"] = {"thruster_limits": True, "plant": plant}
    runs = [
        Run(
            {"case": case, "limits": name, "policy": policy, "number": number},
            policy,
            {"mode": "disturbed", "duration": 30.0} | state | changes,
        )
        for case, number, state in cases
        for name, changes in limits.items()
        for policy in ("learned", "linear", "mpc")
    ]
    title = (
        "30 s with a share of the thruster limits at 16 V; corners in still water, currents from rest"
    )
    return title, runs


def noise_runs(scenario: Scenario, _: argparse.Namespace) -> tuple[str, list[Run]]:
    """Measurement noise, another vehicle as the plant, and all together with limits."""
    half_widths = scenario.station_keeping().half_widths
    states = draw_samples(half_widths, 4, SEED + 3, inner=0.5)
    cases = [("envelope", from_state(state)) for state in states]
    cases += [("current 0.25 m/s", from_state(REST, disturbance=current(0.25)))]
    cases += [("waves Hs 0.5 m", from_state(REST, disturbance=ROUGH))]
    both = {"noise": NOISE, "plant": OTHER, "thruster_limits": True}
    variants: dict[str, dict[str, Any]] = {
        "": {},
        "noise": {"noise": NOISE},
        "mismatch": {"plant": OTHER},
        "noise, mismatch, limits": both,
        "the same, observer 0.3 1/s": both | {"observer_bandwidth": 0.3},
    }
    runs = [
        Run(
            {"case": case, "with": name, "policy": policy},
            policy,
            {"mode": "disturbed", "duration": 40.0} | state | changes,
        )
        for case, state in cases
        for name, changes in variants.items()
        for policy in POLICIES
    ]
    title = (
        f"40 s, from {len(states)} states of the envelope in still water and from rest; noise of 2 cm, "
        f"0.01 rad, 2 cm/s and 0.01 rad/s at every control step; mismatch: the plant is {OTHER}"
    )
    return title, runs
