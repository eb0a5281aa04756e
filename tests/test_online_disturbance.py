"""Disturbances: the wave spectrum, Airy kinematics, published numbers, steps and seeds."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from casadi import SX
from scipy.integrate import quad
from stationkeep.online import DisturbanceSettings, build_disturbance
from stationkeep.online.vehicle import HeldPlant
from stationkeep.online.vehicle.disturbance import GRAVITY, DisturbanceSource, Waves, jonswap

from .games import Array, quick_scenario

HERE = np.array([0.3, -0.4, 0.2])


def single_wave(amplitude: float, period: float, depth: float) -> Waves:
    """A regular wave: one component of a given amplitude [m] and period [s]."""
    waves = Waves(DisturbanceSettings(kind="waves", depth=depth), n_components=1)
    waves.amplitude = np.array([amplitude])
    waves.omega = np.array([2.0 * np.pi / period])
    waves.wavenumber = waves.omega**2 / GRAVITY
    waves.phase = np.zeros(1)
    return waves


def sea(seed: int = 1, heading: float = 30.0) -> DisturbanceSource:
    return build_disturbance(DisturbanceSettings(kind="waves", seed=seed, wave_heading=heading))


@pytest.mark.parametrize(("height", "period"), [(0.25, 4.0), (1.0, 6.0), (3.0, 10.0)])
@pytest.mark.parametrize("enhancement", [1.0, 3.3])
def test_spectrum_has_the_height_and_the_peak(height: float, period: float, enhancement: float) -> None:
    peak = 2.0 * np.pi / period
    omega = np.linspace(0.3 * peak, 8.0 * peak, 20_001)
    S = jonswap(omega, height, period, enhancement)
    assert np.trapezoid(S, omega) == pytest.approx(height**2 / 16.0, rel=1e-9)
    assert omega[S.argmax()] == pytest.approx(peak, rel=1e-3)
    assert S.min() >= 0.0


def test_spectrum_without_enhancement_is_pierson_moskowitz() -> None:
    """S = A ω^-5 exp(-B ω^-4) with B = 5/4 ω_p^4 and A = B H_s^2 / 4 integrates to H_s^2 / 16."""
    height, period = 1.5, 7.0
    B = 1.25 * (2.0 * np.pi / period) ** 4
    omega = np.linspace(0.2, 12.0, 40_001)
    expected = B * height**2 / 4.0 * omega**-5 * np.exp(-B * omega**-4.0)
    np.testing.assert_allclose(jonswap(omega, height, period, 1.0), expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize(
    ("relative", "exponent"),
    [(1.0, 1.0), (0.93, np.exp(-0.5)), (1.09, np.exp(-0.5)), (1.18, np.exp(-2))],
)
def test_enhancement_is_a_bump_around_the_peak(relative: float, exponent: float) -> None:
    """γ at ω_p, of width 0.07 ω_p below and 0.09 ω_p above; far above only the scale is left of it."""
    omega = np.linspace(0.3, 12.0, 40_001)
    ratio = jonswap(omega, 1.0, 6.0, 3.3) / jonswap(omega, 1.0, 6.0, 1.0)
    at = int(np.abs(omega - relative * 2.0 * np.pi / 6.0).argmin())
    assert ratio[at] / ratio[-1] == pytest.approx(3.3**exponent, rel=5e-3)


def test_components_carry_the_variance_of_the_surface() -> None:
    waves = Waves(DisturbanceSettings(kind="waves", wave_height=0.8, wave_period=5.0))
    assert np.sum(waves.amplitude**2) / 2.0 == pytest.approx(0.8**2 / 16.0, rel=1e-9)


@pytest.mark.parametrize("t", [0.0, 3.7, 100.0])
def test_wave_acceleration_is_the_rate_of_the_velocity(t: float) -> None:
    source, h = sea(), 1e-5
    ahead, behind = (source.at(t + s, HERE).water_velocity for s in (h, -h))
    rate = (ahead - behind) / (2.0 * h)
    np.testing.assert_allclose(source.at(t, HERE).water_acceleration, rate, atol=1e-8)
    assert np.abs(rate).max() > 1e-3


def test_wave_velocity_is_a_potential_flow() -> None:
    """Water neither piles up nor spins: div v = 0 and curl v = 0."""
    source, h, t = sea(), 1e-5, 2.3
    gradient = np.empty((3, 3))
    for i in range(3):
        step = h * np.eye(3)[i]
        ahead, behind = source.at(t, HERE + step), source.at(t, HERE - step)
        gradient[:, i] = (ahead.water_velocity - behind.water_velocity) / (2.0 * h)
    assert np.abs(gradient).max() > 1e-3
    assert abs(np.trace(gradient)) < 1e-8
    np.testing.assert_allclose(gradient, gradient.T, atol=1e-8)


def test_regular_wave_has_the_published_size() -> None:
    """H 0.25 m, T 4 s at 3 m depth: about 0.09 m/s; 0.5 m, 5 s: 0.19 m/s; 1 m, 6 s at 5 m: 0.30 m/s."""
    cases = [(0.25, 4.0, 3.0, 0.09), (0.5, 5.0, 3.0, 0.19), (1.0, 6.0, 5.0, 0.30)]
    for height, period, depth, published in cases:
        wave = single_wave(height / 2.0, period, depth)
        times = np.linspace(0.0, period, 400)
        velocity = np.array([wave.at(t, np.zeros(3)).water_velocity for t in times])
        assert velocity[:, 0].max() == pytest.approx(published, abs=0.006)
        # deep water: orbits are circles
        np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), velocity[:, 0].max(), rtol=1e-3)


def test_regular_wave_pushes_with_the_published_force() -> None:
    """0.25 m, 4 s at 3 m: (ρV + M_A) a_w is about 2.9 N on the BlueROV2 Heavy."""
    wave = single_wave(0.125, 4.0, 3.0)
    plant = HeldPlant(quick_scenario().station_keeping(), wave)
    times = np.linspace(0.0, 4.0, 400)
    crossing = times[np.argmin([abs(wave.at(t, np.zeros(3)).water_velocity[0]) for t in times])]
    d = plant.rates(crossing, np.zeros(12), np.zeros(6), np.zeros(6))[2]
    assert abs(d[0]) == pytest.approx(2.9, abs=0.06)


def test_waves_decay_with_depth_and_follow_the_vehicle_down() -> None:
    omega = 2.0 * np.pi / 4.0
    k = omega**2 / GRAVITY
    shallow, deep = single_wave(0.1, 4.0, 2.0), single_wave(0.1, 4.0, 3.5)
    for t in (0.0, 0.9, 2.1):
        at_surface = shallow.at(t, np.zeros(3)).water_velocity
        np.testing.assert_allclose(
            deep.at(t, np.zeros(3)).water_velocity, np.exp(-1.5 * k) * at_surface, atol=1e-12
        )
        lower = shallow.at(t, np.array([0.0, 0.0, 1.5])).water_velocity
        np.testing.assert_allclose(lower, np.exp(-1.5 * k) * at_surface, atol=1e-12)
    above_water = shallow.at(0.3, np.array([0.0, 0.0, -50.0])).water_velocity
    assert np.linalg.norm(above_water) == pytest.approx(0.1 * omega, rel=1e-9)


def test_waves_travel_along_their_heading_at_the_phase_speed() -> None:
    wave = single_wave(0.1, 4.0, 3.0)
    speed = wave.omega[0] / wave.wavenumber[0]
    assert speed == pytest.approx(GRAVITY * 4.0 / (2.0 * np.pi))
    here = wave.at(1.0, np.zeros(3)).water_velocity
    there = wave.at(1.5, np.array([0.5 * speed, 7.0, 0.0])).water_velocity
    np.testing.assert_allclose(here, there, atol=1e-12)
    turned = sea(heading=90.0).at(0.7, np.zeros(3)).water_velocity
    straight = sea(heading=0.0).at(0.7, np.zeros(3)).water_velocity
    np.testing.assert_allclose(turned, [0.0, straight[0], straight[2]], atol=1e-15)


def test_long_record_has_the_variance_of_the_spectrum() -> None:
    """Horizontal and vertical: the integral of S(ω) ω^2 e^{-2 k z}."""
    settings = DisturbanceSettings(kind="waves", wave_height=1.0, wave_period=6.0, depth=5.0)
    peak = 2.0 * np.pi / 6.0
    grid = np.linspace(0.3 * peak, 6.0 * peak, 8001)
    S = jonswap(grid, 1.0, 6.0)
    expected, _ = quad(
        lambda w: float(np.interp(w, grid, S)) * w**2 * np.exp(-2.0 * w**2 / GRAVITY * 5.0),
        grid[0],
        4.0 * peak,
        limit=400,
        epsrel=1e-6,
    )
    records = []
    for seed in (1, 2, 3, 4):
        source = build_disturbance(settings.model_copy(update={"seed": seed}))
        times = np.arange(0.0, 3000.0, 0.5)
        records.append([source.at(t, np.zeros(3)).water_velocity for t in times])
    variance = np.array(records).var(axis=1).mean(axis=0)
    np.testing.assert_allclose(variance[[0, 2]], expected, rtol=0.04)
    assert variance[1] == 0.0


def test_waves_repeat_by_seed_only() -> None:
    first, same, other = sea(1), sea(1), sea(2)
    for t in (0.0, 1.3):
        np.testing.assert_array_equal(first.at(t, HERE).water_velocity, same.at(t, HERE).water_velocity)
        assert np.all(first.at(t, HERE).water_velocity != other.at(t, HERE).water_velocity)


@pytest.mark.parametrize(
    "settings",
    [
        DisturbanceSettings(),
        DisturbanceSettings(kind="constant", force=(1.0, -2.0, 3.0, 0.1, 0.2, -0.3), start=2.0),
        DisturbanceSettings(kind="sinusoid", force=(1.0, -2.0, 3.0, 0.1, 0.2, -0.3), start=0.5),
        DisturbanceSettings(kind="current", velocity=(0.25, -0.1, 0.05), start=2.0),
        DisturbanceSettings(kind="waves", wave_heading=30.0, depth=2.0, seed=4),
    ],
    ids=lambda settings: settings.kind,
)
def test_the_expression_is_the_disturbance(settings: DisturbanceSettings) -> None:
    """At any time and place, at the very instant of the step and above the surface too."""
    source, t, position = build_disturbance(settings), SX.sym("t"), SX.sym("position", 3)
    function = casadi.Function("d", [t, position], list(source.expression(t, position)))
    rng = np.random.default_rng(3)
    times = [0.0, np.nextafter(2.0, 0.0), 2.0, *rng.uniform(0.0, 60.0, 20)]
    for now in times:
        for place in (*rng.uniform(-2.0, 2.0, (3, 3)), np.array([0.0, 1.0, -5.0])):
            here = source.at(float(now), place)
            found = [np.array(part).ravel() for part in function(float(now), place)]
            for part, name in zip(
                found, ("force", "water_velocity", "water_acceleration"), strict=True
            ):
                np.testing.assert_allclose(part, getattr(here, name), rtol=1e-12, atol=1e-13)


FORCE = (1.0, -2.0, 3.0, 0.1, 0.2, -0.3)


def test_constant_force_starts_at_its_time() -> None:
    source = build_disturbance(DisturbanceSettings(kind="constant", force=FORCE, start=2.0))
    assert source.breaks == (2.0,)
    np.testing.assert_array_equal(source.at(1.999, HERE).force, np.zeros(6))
    np.testing.assert_array_equal(source.at(2.0, HERE).force, FORCE)
    np.testing.assert_array_equal(source.at(9.0, HERE).force, FORCE)


def test_sinusoid_has_its_frequency_and_starts_from_zero() -> None:
    source = build_disturbance(
        DisturbanceSettings(kind="sinusoid", force=FORCE, frequency=0.25, start=2.0)
    )
    for t, factor in ((1.5, 0.0), (2.0, 0.0), (3.0, 1.0), (4.0, 0.0), (5.0, -1.0), (7.0, 1.0)):
        np.testing.assert_allclose(source.at(t, HERE).force, factor * np.array(FORCE), atol=1e-12)


def test_current_steps_to_its_velocity() -> None:
    velocity = (0.25, -0.1, 0.0)
    source = build_disturbance(DisturbanceSettings(kind="current", velocity=velocity, start=1.0))
    assert source.breaks == (1.0,)
    np.testing.assert_array_equal(source.at(0.5, HERE).water_velocity, np.zeros(3))
    np.testing.assert_array_equal(source.at(1.0, HERE).water_velocity, velocity)
    np.testing.assert_array_equal(source.at(1.0, HERE).water_acceleration, np.zeros(3))


def test_no_disturbance_is_nothing() -> None:
    source = build_disturbance(DisturbanceSettings())
    here: list[Array] = []
    for t in (0.0, 5.0):
        now = source.at(t, HERE)
        here += [now.force, now.water_velocity, now.water_acceleration]
    assert not any(np.any(a) for a in here)
    assert source.breaks == ()
