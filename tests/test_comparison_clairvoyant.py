"""The clairvoyant optimum of `disturbed` runs: its plant, its bound, its check, its record."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stationkeep.comparison import Scenario
from stationkeep.comparison.records import clairvoyant as module
from stationkeep.comparison.records import clairvoyant_record, contender_record
from stationkeep.comparison.records.clairvoyant import known_stage
from stationkeep.comparison.records.recorded import load_run, run_again
from stationkeep.online import build_disturbance
from stationkeep.online.vehicle import HeldPlant
from stationkeep.symbolic import RunError, Vehicle

from .games import quick_scenario

D = "simulation.disturbance"
SEA = ("simulation.mode=disturbed", "simulation.duration=4")
WAVES = (*SEA, f"{D}.kind=waves", f"{D}.wave_height=0.5")
CURRENT = (*SEA, f"{D}.kind=current", f"{D}.velocity=[0.15,0.1,0]", f"{D}.start=1.3")


@pytest.mark.parametrize("settings", [WAVES, CURRENT], ids=["waves", "current"])
@pytest.mark.parametrize("driven", [None, "bluerov2-heavy-buoyant"])
def test_the_stage_is_the_plant_of_the_runs(settings: tuple[str, ...], driven: str | None) -> None:
    scenario = quick_scenario(*settings)
    station, source = scenario.station_keeping(), build_disturbance(scenario.simulation.disturbance)
    vehicle = None if driven is None else Vehicle.load(driven)
    stage, plant = known_stage(station, source, vehicle), HeldPlant(station, source, vehicle=vehicle)
    rng = np.random.default_rng(5)
    for t in (0.0, 1.0, 2.5, 40.0):
        zeta, u_control = station.half_widths * rng.uniform(-1, 1, 12), rng.uniform(-5, 5, 6)
        J = station.model.kinematics(zeta[:6])[0]
        tau_b = J.T @ (u_control + station.model.u_trim)
        rates, held, _ = plant.rates(t, zeta, tau_b, np.zeros(6))
        rate, running = stage.kernel(zeta, u_control, np.array([t]))
        np.testing.assert_allclose(held, u_control, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(rate, rates[:12], rtol=1e-9, atol=1e-9)
        assert running == pytest.approx(rates[12], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [WAVES, CURRENT], ids=["waves", "current"])
def test_no_policy_costs_less_and_the_plant_agrees(settings: tuple[str, ...]) -> None:
    scenario = quick_scenario(*settings)
    record = clairvoyant_record(scenario)
    value = record.attrs["value"]
    for name in ("linear", "lqr", "mpc"):
        run = contender_record(scenario, name)
        np.testing.assert_allclose(run["zeta"].values[0], record["zeta"].values[0], atol=1e-12)
        assert float(run["cost"][-1]) > value * (1.0 + 1e-3)
    assert record.attrs["faults"] == ""
    assert record.attrs["mesh_error"] <= 1e-5
    assert record.attrs["reintegration_error"] < 1e-6
    assert record.attrs["final_defect"] < 1e-4
    assert record.attrs["start_spread"] < 1e-6
    assert float(record["cost"][-1]) == pytest.approx(value, rel=1e-12)
    assert record["time"].values[-1] == pytest.approx(4.0)


@pytest.mark.slow
def test_its_record_is_kept_for_its_run_and_can_be_replayed(tmp_path: Path) -> None:
    path, scenario = tmp_path / "clairvoyant.nc", quick_scenario(*SEA, "simulation.duration=1")
    first = clairvoyant_record(scenario, path)
    before = path.stat().st_mtime_ns
    xr.testing.assert_identical(clairvoyant_record(scenario, path), first)
    other = scenario.with_settings(learner={"period": 0.1}, samples={"seed": 7})
    xr.testing.assert_identical(clairvoyant_record(other, path), first)
    assert path.stat().st_mtime_ns == before
    again = run_again(load_run(path), tmp_path)
    np.testing.assert_allclose(again["zeta"].values, first["zeta"].values, atol=1e-12)
    for changes in ({"duration": 1.1}, {"disturbance": {"kind": "waves"}}, {"plant": "rexrov"}):
        changed = scenario.with_settings(simulation=changes)
        assert module.clairvoyant_provenance(changed)["key"] != first.attrs["key"], changes


def test_a_solve_that_fails_is_kept_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Scenario] = []

    def failing(scenario: Scenario) -> None:
        calls.append(scenario)
        raise RunError("IPOPT stopped")

    monkeypatch.setattr(module, "clairvoyant", failing)
    for _ in range(2):
        with pytest.raises(RunError, match="IPOPT stopped"):
            clairvoyant_record(quick_scenario(*WAVES), tmp_path / "clairvoyant.nc")
    assert len(calls) == 1
