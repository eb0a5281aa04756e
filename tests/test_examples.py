"""The examples: short, run, and each right about something that is known from elsewhere."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.linalg import solve_continuous_are
from scipy.optimize import brentq
from stationkeep.comparison import Scenario
from stationkeep.symbolic import Vehicle, two_state_game

from .commands import call, files_in, sets
from .games import TWO_STATE_WEIGHTS, Array

Capture = pytest.CaptureFixture[str]
FOLDER = Path(__file__).resolve().parents[1] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
FACES = {"stationkeep", *(f"stationkeep.{name}" for name in ("symbolic", "online", "offline"))}
FACES |= {"stationkeep.comparison"}
QUICK = sets("samples.number=50", "simulation.duration=1.0")
OWN = f"{FOLDER / 'own_policy.py'}"


@cache
def example(name: str) -> ModuleType:
    """Return an example as a module."""
    found = spec_from_file_location(name, FOLDER / f"{name}.py")
    assert found is not None
    assert found.loader is not None
    module = module_from_spec(found)
    found.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_uses_what_is_public(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 60
    tree = ast.parse(text)
    assert ast.get_docstring(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            parts = (node.module or "").split(".")
            if parts[0] == "stationkeep":  # the package, a folder's face, or a wing's
                assert ".".join(parts[:2]) in FACES
                assert len(parts) <= 3
                assert not any(alias.name.startswith("_") for alias in node.names)


def test_each_example_has_a_line_in_the_readme_and_a_test() -> None:
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    here = Path(__file__).read_text(encoding="utf-8")
    for path in EXAMPLES:
        assert text.count(f"[{path.name}]({path.name})") == 1
        assert f'example("{path.stem}")' in here


def test_own_plant() -> None:
    """The value is Pontryagin's boundary value problem, solved by scipy; nothing costs less."""
    module = example("own_plant")
    optimum, learned = module.main()
    assert optimum == pytest.approx(pendulum(module.START), rel=1e-6)
    assert optimum < learned < 1.01 * optimum


def pendulum(start: Array) -> float:
    """Return V of the pendulum: v = -R_eff^-1 g'λ / 2 and λ_dot = -2 Q ζ - f_ζ'λ, λ(T) = 2 P ζ(T)."""
    gravity, length, mass, friction = 9.81, 0.5, 0.4, 0.02
    inertia, Q = mass * length**2, np.array([4.0, 0.2])
    R_eff = 0.5 / (1.0 - 1.0 / 9.0)
    a, b, g = mass * gravity * length / inertia, friction / inertia, 1.0 / inertia
    P = solve_continuous_are([[0.0, 1.0], [a, -b]], [[0.0], [g]], np.diag(Q), [[R_eff]])

    def rates(t: Array, y: Array) -> Array:
        phi, rate, l_1, l_2, _ = y
        v = -0.5 * g * l_2 / R_eff
        return np.stack(
            [
                rate,
                a * np.sin(phi) - b * rate + g * v,
                -2.0 * Q[0] * phi - a * np.cos(phi) * l_2,
                -2.0 * Q[1] * rate - l_1 + b * l_2,
                Q[0] * phi**2 + Q[1] * rate**2 + R_eff * v**2,
            ]
        )

    def ends(first: Array, last: Array) -> Array:
        costate = last[2:4] - 2.0 * P @ last[:2]
        return np.array([*(first[:2] - start), *costate, first[4]])

    t = np.linspace(0.0, 4.0, 200)
    guess = np.outer([*start, *(2.0 * P @ start), 0.0], np.exp(-3.0 * t))
    found = solve_bvp(rates, ends, t, guess, tol=1e-9, max_nodes=20_000)
    assert found.success
    end = found.y[:, -1]
    return float(end[4] + end[:2] @ P @ end[:2])


def test_own_basis() -> None:
    """V* = x^2 + x^4 / 2 in closed form, where the quadratic basis has x^2 alone."""
    weights, value = example("own_basis").main()
    np.testing.assert_allclose(weights, [1.0, 0.5], atol=2e-3)
    assert value == pytest.approx(0.9**2 + 0.9**4 / 2.0, rel=1e-3)


def test_own_critic() -> None:
    np.testing.assert_allclose(example("own_critic").main(), TWO_STATE_WEIGHTS, atol=1e-5)


def test_own_policy() -> None:
    """At rest x1 = x2 and f_2 + c (u_1 + 1/2) = 0; integral action brings u_1 = -1/2 and x = 0."""
    module = example("own_policy")
    K = two_state_game().linear_gains[0]
    np.testing.assert_allclose(K, [[0.0, 3.0]], atol=1e-9)  # R^-1 g(0)'P with P = diag(1/2, 1)

    def balance(x: float) -> float:
        c = np.cos(2.0 * x) + 2.0
        return float(-0.5 * x - 0.5 * x * (1.0 - 0.75 * c**2) + c * (0.5 - 3.0 * x))

    without, with_memory = module.main()
    np.testing.assert_allclose(without, brentq(balance, 0.0, 1.0), rtol=1e-6)
    np.testing.assert_allclose(with_memory, 0.0, atol=1e-8)


def test_own_disturbance() -> None:
    """Springs in balance: the linear policy's against the tether's, and against a wave's push."""
    module = example("own_disturbance")
    end, amplitude = module.main()
    problem = Scenario.load("bluerov2-heavy", ["basis.name=quadratic"]).setup().problem
    A, B = problem.linearization
    spring = np.zeros((6, 12))
    spring[:3, :3] = module.STIFFNESS * np.eye(3)
    pull = np.append(module.STIFFNESS * module.ANCHOR, np.zeros(3))
    balance = np.linalg.solve(A - B @ (problem.linear_gains[0] + spring), -B @ pull)
    np.testing.assert_allclose(end[:3], balance[:3], atol=2e-3)
    # q_p = q_v = r = 1, γ = 2: ρ = 4/3, p_12 = sqrt(ρ), p_22 = sqrt(ρ (1 + 2 p_12)); held over 20 ms
    p_12 = np.sqrt(4.0 / 3.0)
    K, h = np.array([[p_12, np.sqrt(4.0 / 3.0 * (1.0 + 2.0 * p_12))]]), 0.02
    held, push = np.array([[1.0, h], [0.0, 1.0]]), np.array([[h**2 / 2.0], [h]])
    z = np.exp(1j * module.OMEGA * h) * np.eye(2)
    response = module.AMPLITUDE * abs(np.linalg.solve(z - held + push @ K, push)[0, 0])
    assert amplitude == pytest.approx(response, rel=3e-4)  # the peak lies between two samples


def test_paper_loop() -> None:
    zeta, *weights = np.split(example("paper_loop").main(), [2, 5, 8])
    np.testing.assert_allclose(weights, [TWO_STATE_WEIGHTS] * 3, atol=1e-6)
    np.testing.assert_allclose(zeta, 0.0, atol=1e-6)


def test_vehicle_loop() -> None:
    """It is where it shall be, and what holds it there is W - B, upwards."""
    error, tau_b = example("vehicle_loop").main()
    assert np.abs(error).max() < 0.01
    vehicle = Vehicle.load("bluerov2-heavy-buoyant")
    expected = [0.0, 0.0, vehicle.buoyancy - vehicle.weight, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(tau_b, expected, atol=0.05)


@pytest.mark.slow
def test_functions() -> None:
    """From (1, -1) the value is 3/2; no saddle gap; the linear policy's worst case is more."""
    found = example("functions").main()
    assert found["solve"] == pytest.approx(1.5, rel=1e-7)
    assert found["gamma_curve"] == pytest.approx(1.5, rel=1e-7)
    assert abs(found["saddle_gap"]) < 1e-6
    assert found["worst_case"] > 1.5
    np.testing.assert_allclose(
        [found[name] for name in ("11", "12", "22")], TWO_STATE_WEIGHTS, atol=1e-6
    )
    assert found["replay"] == 0.0
    assert 0.0 < found["compare"] < 0.01
    assert found["sweep"] == 2 * 2  # states and policies
    assert min(found[name] for name in ("generate", "check", "export", "write_report")) > 0


def test_an_example_runs_as_a_program(tmp_path: Path) -> None:
    command = [sys.executable, str(FOLDER / "paper_loop.py")]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("state")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str, Path]:
    """A comparison of the two-state game with two policies of one's own, from two states."""
    folder = tmp_path_factory.mktemp("own")
    words = ["compare", f"{OWN}:problem", "--json", "--quiet", "--n-states", "2", "--workers", "1"]
    words += ["--policy", f"{OWN}:make", "--policy", f"{OWN}:Integral", "--out", str(folder)]
    command = [sys.executable, "-m", "stationkeep.cli.main", *words, *QUICK]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), (folder / "report.html").read_text(encoding="utf-8"), folder


@pytest.mark.slow
def test_own_policies_are_compared_from_every_state(
    study: tuple[dict[str, Any], str, Path],
) -> None:
    answer, report, folder = study
    for name, label in ((f"{OWN}:make", "own_policy"), (f"{OWN}:Integral", "Integral")):
        assert answer["regret"][name]["median"] > answer["regret"]["learned"]["median"]
        assert f"<td>{label}</td>" in report
        assert f"--policy {name}" in report
        for prefix in ("", "state-2-"):
            assert f"records/{prefix}own-{label}.nc" in files_in(folder)


def test_own_policies_in_a_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    """Integral action costs more on the way home than nothing but the linear policy."""
    monkeypatch.chdir(tmp_path)
    policies = f"linear,{OWN}:make,{OWN}:Integral"
    words = ("sweep", f"{OWN}:problem", "--policies", policies, "--workers", "1", "--json", "--quiet")
    answer = call(capsys, *words, "--out", "out", "--states", "2", *sets("samples.number=50"))
    assert answer.code == 0, answer.err
    groups = {group["policy"]: group["regret"] for group in answer.json()["summary"]}
    assert set(groups) == set(policies.split(","))
    assert all(group["median"] > 0.0 for group in groups.values())


@pytest.mark.slow
def test_own_plant_and_own_critic_are_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    rule = f"learner.rule='{FOLDER / 'own_critic.py'}:make'"
    words = ("compare", f"{FOLDER / 'own_plant.py'}:problem", "--json", "--quiet", "--n-states", "1")
    answer = call(capsys, *words, "--out", "out", *sets("samples.number=50", rule))
    assert answer.code == 0, answer.err
    regret = answer.json()["regret"]
    assert 0.0 < regret["learned"]["median"] < 0.02
