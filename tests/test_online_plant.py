"""The vehicle under held commands: against scipy on the model's plant, and what d(t) means."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from stationkeep.online import DisturbanceSettings, build_disturbance
from stationkeep.online.loop import PlantState
from stationkeep.online.vehicle import Disturbance, HeldPlant
from stationkeep.symbolic import RunError, StationKeeping

from .games import Array, quick_scenario

ZETA = np.array([0.7, -0.3, 0.4, 0.25, -0.3, 0.8, 0.2, -0.1, 0.15, 0.1, -0.2, 0.3])
TAU_B = np.array([5.0, -3.0, 4.0, 0.4, -0.6, 0.5])
TAU_D = np.array([-1.0, 2.0, -0.5, 0.2, 0.1, -0.3])
NOTHING = np.zeros(6)


def station() -> StationKeeping:
    return quick_scenario().station_keeping()


def plant(tolerance: float = 1e-10, **disturbance: object) -> HeldPlant:
    settings = DisturbanceSettings.model_validate(disturbance)
    return HeldPlant(station(), build_disturbance(settings), tolerance)


def kinematics(zeta: Array) -> Array:
    return np.asarray(station().model.kinematics(zeta[:6])[0])


def by_scipy(tau: Array, t_end: float, water: Array | None = None, start: Array = ZETA) -> Array:
    """Integrate the model's plant under a constant body wrench, by another method."""
    model = station().model
    velocity = np.zeros(3) if water is None else water

    def rate(t: float, zeta: Array) -> Array:
        return model.plant(zeta, tau, NOTHING, velocity, np.zeros(3))[0]

    answer = solve_ivp(rate, (0.0, t_end), start, "LSODA", rtol=1e-11, atol=1e-12)
    return np.asarray(answer.y[:, -1])


def test_held_wrenches_move_the_vehicle_as_the_model_says() -> None:
    end = plant().advance(0.0, PlantState(ZETA, 0.0, 0.0), TAU_B, TAU_D, 1.5)
    np.testing.assert_allclose(end.zeta, by_scipy(TAU_B + TAU_D, 1.5), atol=1e-8)
    assert np.abs(end.zeta - ZETA).max() > 0.1


def test_steps_compose() -> None:
    whole = plant().advance(0.0, PlantState(ZETA, 0.0, 0.0), TAU_B, TAU_D, 0.8)
    state = PlantState(ZETA, 0.0, 0.0)
    for i in range(8):
        state = plant().advance(0.1 * i, state, TAU_B, TAU_D, 0.1)
    np.testing.assert_allclose(state.zeta, whole.zeta, atol=1e-9)
    assert state.cost == pytest.approx(whole.cost, rel=1e-9)
    assert state.attenuated == pytest.approx(whole.attenuated, rel=1e-9)


def test_costs_are_the_integrals_of_their_rates() -> None:
    """ζ'Qζ + u_1'R u_1 with u_1 = J^-T τ_b, and γ^2 d'W_d d with d = J^-T τ_d, along the motion."""
    game = station().game
    end = plant().advance(0.0, PlantState(ZETA, 3.0, 5.0), TAU_B, TAU_D, 0.5)
    model = station().model

    def rate(t: float, y: Array) -> Array:
        zeta = y[:12]
        inverse = np.linalg.inv(kinematics(zeta)).T
        u, d = inverse @ TAU_B, inverse @ TAU_D
        moved = model.plant(zeta, TAU_B, TAU_D, np.zeros(3), np.zeros(3))[0]
        cost = zeta @ game.Q @ zeta + u @ game.R @ u
        return np.append(moved, [cost, game.gamma**2 * d @ game.W_d @ d])

    y0 = np.append(ZETA, [3.0, 5.0])
    answer = solve_ivp(rate, (0.0, 0.5), y0, "RK45", rtol=1e-9, atol=1e-10).y[:, -1]
    assert end.cost == pytest.approx(answer[12], rel=1e-7)
    assert end.attenuated == pytest.approx(answer[13], rel=1e-7)


def test_in_a_game_the_disturbance_is_the_other_players_force() -> None:
    rates, u_control, d = plant().rates(0.0, ZETA, TAU_B, TAU_D)
    inverse = np.linalg.inv(kinematics(ZETA)).T
    np.testing.assert_allclose(d, inverse @ TAU_D, rtol=1e-10)
    np.testing.assert_allclose(u_control, inverse @ TAU_B, rtol=1e-10)
    setup = station()
    both = setup.model.drift(ZETA) + setup.model.input_matrix(ZETA) @ (u_control + d)
    np.testing.assert_allclose(rates[:12], both, atol=1e-10)


def test_an_earth_frame_force_is_the_disturbance_itself() -> None:
    force = (1.0, -2.0, 3.0, 0.1, 0.2, -0.3)
    d = plant(kind="constant", force=force).rates(0.0, ZETA, TAU_B, NOTHING)[2]
    np.testing.assert_allclose(d, force, rtol=1e-10)


@pytest.mark.parametrize("zeta", [np.zeros(12), ZETA])
def test_current_amounts_to_the_force_that_the_still_water_model_misses(zeta: Array) -> None:
    """d = M_bar η_ddot + C_bar η_dot + D_bar η_dot + g_bar - τ_bar_b with the true η_ddot."""
    velocity = (0.25, -0.1, 0.05)
    rates, _, d = plant(kind="current", velocity=velocity).rates(1.0, zeta, TAU_B, NOTHING)
    M_bar, C_bar, D_bar, g_bar = station().model.earth_frame(zeta)
    missing = M_bar @ rates[6:12] + (C_bar + D_bar) @ zeta[6:] + g_bar
    missing -= np.linalg.inv(kinematics(zeta)).T @ TAU_B
    np.testing.assert_allclose(d, missing, atol=1e-10 * np.abs(missing).max())
    assert np.abs(d).max() > 1.0


def test_half_a_metre_a_second_of_current_costs_the_published_force() -> None:
    """On the vehicle at rest: 42 N from ahead (141 * .5^2 + 13.7 * .5), 54 N from abeam."""
    for axis, published in ((0, 141.0 * 0.25 + 13.7 * 0.5), (1, 217.0 * 0.25)):
        velocity = [0.0, 0.0, 0.0]
        velocity[axis] = 0.5
        d = plant(kind="current", velocity=velocity).rates(0.0, np.zeros(12), NOTHING, NOTHING)[2]
        assert d[axis] == pytest.approx(published, rel=1e-9)


def test_current_step_inside_a_period_is_met_exactly() -> None:
    velocity = np.array([0.3, 0.2, 0.0])
    stepped = plant(kind="current", velocity=tuple(velocity), start=0.13)
    end = stepped.advance(0.0, PlantState(ZETA, 0.0, 0.0), TAU_B, NOTHING, 0.5)
    first = by_scipy(TAU_B, 0.13)
    expected = by_scipy(TAU_B, 0.5 - 0.13, water=velocity, start=first)
    np.testing.assert_allclose(end.zeta, expected, atol=1e-8)


class Counted:
    """A source that counts how often it is asked, by scipy's integrator alone."""

    steady = False

    def __init__(self, settings: DisturbanceSettings) -> None:
        self.source, self.calls = build_disturbance(settings), 0
        self.breaks = self.source.breaks

    def at(self, t: float, position: Array) -> Disturbance:
        self.calls += 1
        return self.source.at(t, position)


@pytest.mark.parametrize("start", [0.01, 0.02])
def test_step_does_not_shorten_the_integrators_steps(start: float) -> None:
    """The force before a step is smooth up to it: about one DOP853 step on either side."""
    counts = []
    for force in (0.0, 5.0):
        settings = DisturbanceSettings(kind="constant", force=(force, 0, 0, 0, 0, 0), start=start)
        source = Counted(settings)
        held = HeldPlant(station(), source, 1e-8)
        held.advance(0.0, PlantState(ZETA, 0.0, 0.0), TAU_B, NOTHING, 0.02)
        counts.append(source.calls)
    assert counts[1] <= 3 * counts[0], counts


@pytest.mark.parametrize(
    "settings",
    [
        DisturbanceSettings(),
        DisturbanceSettings(kind="constant", force=(3, -2, 1, 0.1, 0, 0.2), start=0.013),
        DisturbanceSettings(kind="current", velocity=(0.4, 0.2, -0.1), start=0.01),
    ],
    ids=lambda settings: settings.kind,
)
@pytest.mark.parametrize("dt", [0.02, 0.5])
def test_the_compiled_step_goes_where_scipys_integrator_goes(
    settings: DisturbanceSettings, dt: float
) -> None:
    """At 1e-12 scipy's DOP853 is exact here; one step over 0.5 s is too long and is refused."""
    ends = []
    for source, tolerance in ((build_disturbance(settings), 1e-8), (Counted(settings), 1e-12)):
        state = PlantState(ZETA, 1.0, 0.5)
        for i in range(5):
            state = HeldPlant(station(), source, tolerance).advance(
                i * dt, state, TAU_B, 0.1 * TAU_B, dt
            )
        ends.append(np.append(state.zeta, [state.cost, state.attenuated]))
    gap = np.abs((ends[0] - ends[1])[:12] / station().half_widths).max()
    assert gap < 1e-7
    np.testing.assert_allclose(ends[0][12:], ends[1][12:], rtol=1e-6)


def test_a_step_that_is_too_long_is_refused_by_its_own_estimate() -> None:
    held = HeldPlant(station(), build_disturbance(DisturbanceSettings()), 1e-8)
    y = np.append(ZETA, [0.0, 0.0])
    assert held._one_step(0.0, 0.02, y, TAU_B, NOTHING) is not None
    assert held._one_step(0.0, 5.0, y, TAU_B, NOTHING) is None
    assert held._one_step(0.0, 0.02, np.full(14, np.nan), TAU_B, NOTHING) is None


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_error_control_keeps_its_word(tolerance: float) -> None:
    """Ten times the tolerance over 2 s in waves, in half-widths; looser means cheaper."""
    ends, calls = [], []
    for level in (tolerance, 1e-12):
        source = Counted(DisturbanceSettings(kind="waves"))
        held = HeldPlant(station(), source, level)
        state = PlantState(ZETA, 0.0, 0.0)
        ends.append(held.advance(0.0, state, 0.3 * TAU_B, NOTHING, 2.0).zeta)
        calls.append(source.calls)
    gap = np.abs((ends[0] - ends[1]) / station().half_widths).max()
    assert 0.0 < gap < 10.0 * tolerance
    assert calls[0] < calls[1]


def test_nan_wrench_is_a_failure_not_a_state() -> None:
    wrench = np.full(6, np.nan)
    with pytest.raises(RunError, match=r"t = 4\.00"):
        plant().advance(4.0, PlantState(ZETA, 0.0, 0.0), wrench, NOTHING, 0.02)
