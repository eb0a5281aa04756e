"""Meshes, and the times at which velocities change sign."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import casadi
import numpy as np
import pytest
from casadi import SX
from hypothesis import given
from hypothesis import strategies as st
from stationkeep.offline import DirectSolver, MeshSettings, Plant, Trajectory
from stationkeep.offline.path import RadauRule, aligned_mesh, graded_mesh, settle, sign_changes
from stationkeep.symbolic import Game, InputError, Problem

from .games import Array, two_state


@pytest.mark.parametrize("grading", [0.5, 2.0, 5.0, 9.0])
@pytest.mark.parametrize("n_intervals", [2, 7, 40])
def test_graded_mesh_grows_geometrically(grading: float, n_intervals: int) -> None:
    mesh = graded_mesh(60.0, n_intervals, grading)
    lengths = np.diff(mesh)
    assert mesh.shape == (n_intervals + 1,)
    assert mesh[0] == 0.0
    assert mesh[-1] == pytest.approx(60.0, rel=1e-14)
    np.testing.assert_allclose(lengths[1:] / lengths[:-1], np.exp(grading / n_intervals), rtol=1e-8)
    # a is the logarithm of the ratio of the mesh's slopes at both ends: (K - 1)/K of it between the
    # first and the last of K intervals
    expected = grading * (n_intervals - 1) / n_intervals
    assert np.log(lengths[-1] / lengths[0]) == pytest.approx(expected, rel=1e-8)


@given(horizon=st.floats(0.1, 1e3), n_intervals=st.integers(1, 100), grading=st.floats(0.0, 9.0))
def test_mesh_ends_exactly_at_its_horizon(horizon: float, n_intervals: int, grading: float) -> None:
    """A trajectory is at rest beyond its last mesh point, so its last instant must not be beyond."""
    assert graded_mesh(horizon, n_intervals, grading)[-1] == horizon


def test_no_grading_is_uniform() -> None:
    np.testing.assert_allclose(graded_mesh(10.0, 5, 0.0), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0])
    np.testing.assert_allclose(graded_mesh(10.0, 5, 1e-9), graded_mesh(10.0, 5, 0.0), rtol=1e-8)
    np.testing.assert_array_equal(graded_mesh(3.0, 1, 4.0), [0.0, 3.0])


def test_twice_the_intervals_halve_every_interval() -> None:
    coarse, fine = graded_mesh(120.0, 40, 5.0), graded_mesh(120.0, 80, 5.0)
    np.testing.assert_allclose(fine[::2], coarse, rtol=1e-12)


gradings = st.just(0.0) | st.floats(1e-3, 9.0)
meshes = st.builds(graded_mesh, st.floats(1.0, 200.0), st.integers(2, 40), gradings)
thousandths = st.lists(st.integers(1, 999), max_size=6, unique=True)


@given(mesh=meshes, thousandths=thousandths)
def test_aligned_mesh_has_a_point_at_every_event(mesh: Array, thousandths: list[int]) -> None:
    events = mesh[-1] * np.array(thousandths) / 1000.0
    aligned = aligned_mesh(mesh, events)
    assert np.all(np.isin(events, aligned)), sorted(set(events) - set(aligned))
    assert np.all(np.diff(aligned) > 0.0)
    assert aligned[0] == mesh[0]
    assert aligned[-1] == mesh[-1]
    assert len(mesh) <= len(aligned) <= len(mesh) + len(events)


@given(mesh=meshes, fraction=st.floats(0.001, 0.999))
def test_one_event_moves_or_adds_one_point(mesh: Array, fraction: float) -> None:
    event = float(mesh[-1] * fraction)
    aligned = aligned_mesh(mesh, np.array([event]))
    assert event in aligned
    assert np.all(np.diff(aligned) > 0.0)
    untouched = np.isin(mesh, aligned)
    assert np.count_nonzero(~untouched) <= 1
    # where a point moved, it moved by less than a fifth of its shorter interval
    for i in np.flatnonzero(~untouched):
        assert abs(mesh[i] - event) < 0.2 * min(mesh[i] - mesh[i - 1], mesh[i + 1] - mesh[i])


def test_two_events_beside_one_point_both_get_theirs() -> None:
    aligned = aligned_mesh(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.02, 1.1]))
    assert 1.02 in aligned
    assert 1.1 in aligned


def test_events_at_or_beyond_the_ends_leave_them() -> None:
    mesh = np.array([0.0, 1.0, 2.0])
    np.testing.assert_array_equal(aligned_mesh(mesh, np.array([0.0, 2.0, 2.5])), mesh)
    np.testing.assert_array_equal(aligned_mesh(mesh, np.empty(0)), mesh)
    np.testing.assert_array_equal(aligned_mesh(mesh, np.array([1.0])), mesh)


NAMED = ["direct", "certified", "saddle", "quick", "fine", "prediction"]


@pytest.mark.parametrize("name", NAMED)
def test_named_settings_give_their_mesh(name: str) -> None:
    settings: MeshSettings = getattr(MeshSettings, name)
    lengths = np.diff(settings.points)
    assert len(lengths) == settings.n_intervals
    assert settings.points[-1] == settings.horizon
    ratio = np.exp(settings.grading * (1.0 - 1.0 / settings.n_intervals))
    assert lengths[-1] / lengths[0] == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize("grading", [0.0, 3.0, 6.0])
def test_lengthened_settings_keep_the_first_intervals(grading: float) -> None:
    short = MeshSettings(horizon=60.0, n_intervals=20, degree=5, grading=grading)
    long = short.lengthened(150.0)
    assert long.points[-1] == 150.0
    assert long.degree == 5
    first = np.diff(short.points)[0], np.diff(long.points)[0]
    assert first[1] == pytest.approx(first[0], rel=0.1)
    assert short.lengthened(60.0) == short


@pytest.mark.parametrize(
    "change",
    [{"horizon": 0.0}, {"horizon": np.inf}, {"n_intervals": 0}, {"degree": 0}, {"grading": -1.0}],
)
def test_settings_that_are_no_mesh_are_refused(
    change: dict[str, float], one_sentence: Callable[[BaseException], str]
) -> None:
    with pytest.raises(InputError) as refused:
        DirectSolver(two_state()[0], **change)  # type: ignore[arg-type]
    assert "mesh" in one_sentence(refused.value)


def test_settings_and_keywords_are_one_mesh() -> None:
    problem, _, _ = two_state()
    settings = MeshSettings.direct.changed(horizon=12.0, n_intervals=9)
    one, other = DirectSolver(problem, settings), DirectSolver(problem, horizon=12.0, n_intervals=9)
    np.testing.assert_array_equal(one.mesh, other.mesh)
    assert one.degree == other.degree == MeshSettings.direct.degree


def oscillators() -> Plant:
    """Three states that switch where they vanish; their dynamics play no part."""
    zeta = SX.sym("zeta", 3)
    game = Game(np.eye(3), np.eye(3), np.eye(3), 2.0)
    problem = Problem("switches", zeta, -zeta, SX.eye(3), game, np.ones(3), switching=zeta)
    return Plant(problem)


def path_of(functions: list[object], mesh: Array, degree: int = 5) -> Trajectory:
    """Return the interpolating trajectory of three functions of time."""
    nodes = RadauRule(degree).nodes
    times = np.append(mesh[0], (mesh[:-1, None] + np.diff(mesh)[:, None] * nodes).ravel())
    states = np.stack([function(times) for function in functions], axis=1)  # type: ignore[operator]
    return Trajectory(mesh, times, states, np.zeros((len(times) - 1, 3)), degree)


def test_sign_changes_finds_every_crossing() -> None:
    """Of sin, of a cubic and of a function that never crosses, on an uneven mesh."""
    mesh = graded_mesh(10.0, 30, 2.0)
    path = path_of(
        [
            lambda t: np.sin(t + 0.3),
            lambda t: (t - 0.7) * (t - 0.9) * (t - 8.1) / 10.0,
            lambda t: 2.0 + np.cos(t),
        ],
        mesh,
    )
    expected = np.sort([np.pi - 0.3, 2 * np.pi - 0.3, 3 * np.pi - 0.3, 0.7, 0.9, 8.1])
    np.testing.assert_allclose(sign_changes(oscillators(), path), expected, atol=1e-6)


@pytest.mark.parametrize("root", [1.0, 0.5, 0.25, 1.5, 0.3])
def test_crossings_at_points_that_are_looked_at_are_found(root: float) -> None:
    """Mesh points and eighths of an interval, where the function may vanish exactly."""
    constant = np.ones_like
    path = path_of([lambda t: t - root, constant, constant], np.array([0.0, 1.0, 2.0]), degree=2)
    np.testing.assert_allclose(sign_changes(oscillators(), path), [root], atol=1e-10)


def test_start_at_rest_is_no_crossing() -> None:
    """Velocities that begin at exactly zero, as every run from rest does."""
    constant = np.ones_like
    path = path_of([lambda t: t * (3.0 - t), lambda t: -t, constant], np.linspace(0.0, 2.0, 5))
    assert len(sign_changes(oscillators(), path)) == 0


def test_touching_zero_is_no_crossing() -> None:
    constant = np.ones_like
    path = path_of([lambda t: (t - 0.77) ** 2, constant, constant], np.linspace(0.0, 2.0, 5))
    assert len(sign_changes(oscillators(), path)) == 0


def test_weak_swings_are_left_out() -> None:
    """Below 1e-4 on either side of a crossing it does not matter."""
    constant = np.ones_like
    mesh = np.linspace(0.0, 12.0, 41)
    path = path_of([lambda t: 5e-5 * np.sin(t + 1.0), lambda t: 3e-4 * np.sin(t + 1.0), constant], mesh)
    found = sign_changes(oscillators(), path)
    np.testing.assert_allclose(found, np.pi * np.arange(1, 5) - 1.0, atol=1e-4)
    assert len(sign_changes(oscillators(), path, smallest=1e-3)) == 0
    assert len(sign_changes(oscillators(), path, smallest=1e-6)) == 8


def test_smooth_plant_has_no_switches() -> None:
    problem, _, _ = two_state()
    mesh = np.linspace(0.0, 2.0, 5)
    path = path_of([np.sin, np.cos, np.ones_like], mesh)
    assert sign_changes(Plant(problem), path).shape == (0,)
    assert casadi.SX(problem.switching).shape[0] == 0


def test_mesh_settles_on_an_event_that_moves_with_the_mesh() -> None:
    """A solution whose crossing is a thousand times nearer to t = 0.7 after every solve."""
    mesh, constant = np.linspace(0.0, 2.0, 5), np.ones_like
    meshes: list[Array] = []

    def crossing(k: int) -> float:
        return 0.7 + 0.1 * 0.001**k

    def solve_on(points: Array, before: Trajectory | None) -> Trajectory:
        meshes.append(points)
        root = crossing(len(meshes) - 1)
        return path_of([lambda t: t - root, constant, constant], points)

    solutions, events = settle(oscillators(), mesh, solve_on(mesh, None), lambda path: path, solve_on)
    # the fourth solution has its crossing within 1e-6 of the mesh point that the third gave it
    assert len(solutions) == len(meshes) == 4
    np.testing.assert_allclose(events, [crossing(2)], atol=1e-10)
    for k, points in enumerate(meshes[1:]):
        np.testing.assert_allclose(points, [0.0, 0.5, crossing(k), 1.0, 1.5, 2.0], atol=1e-10)


def test_mesh_that_does_not_settle_ends_after_its_rounds() -> None:
    constant = np.ones_like

    def solve_on(points: Array, before: Trajectory | None) -> Trajectory:
        root = 0.9 if before is None or before.states[0, 0] > -0.8 else 0.6
        return path_of([lambda t: t - root, constant, constant], points)

    mesh = np.linspace(0.0, 2.0, 5)
    first = solve_on(mesh, None)
    solutions, events = settle(oscillators(), mesh, first, lambda path: path, solve_on, rounds=3)
    assert len(solutions) == 4
    np.testing.assert_allclose(events, [0.9], atol=1e-10)
    fixed, _ = settle(
        oscillators(), mesh, first, lambda path: path, solve_on, fixed=np.array([1.0]), rounds=1
    )
    np.testing.assert_allclose(fixed[-1].mesh, [0.0, 0.5, 0.9, 1.0, 1.5, 2.0], atol=1e-10)


@pytest.mark.parametrize("name", NAMED)
def test_the_documentation_says_what_the_named_settings_are(name: str) -> None:
    text = (Path(__file__).parents[1] / "docs" / "theory" / "optimum.md").read_text(encoding="utf-8")
    (row,) = [line for line in text.splitlines() if line.startswith(f"| `{name}` |")]
    horizon, *others = [cell.strip() for cell in row.split("|")[2:6]]
    settings: MeshSettings = getattr(MeshSettings, name)
    assert [float(cell) for cell in others] == [
        settings.n_intervals,
        settings.degree,
        settings.grading,
    ]
    assert horizon == ("by decay" if name == "certified" else f"{settings.horizon:g}")
