"""The figures that only a vehicle has: its pose and rates, forces in both frames, thrusters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.optimize import linprog

from ...symbolic import RunError, StationKeeping, Thrusters
from ..records import optimum_name
from ..study import Comparison
from .path_figure import draw_path
from .style import Page, legend_above, legend_below, line_color, pair, time_axis
from .verdict_figures import draw_energy

Panel = tuple[str, float]
_POSE: list[Panel] = [
    ("x [m]", 1.0),
    ("y [m]", 1.0),
    ("z, down [m]", 1.0),
    ("roll φ [deg]", np.degrees(1.0)),
    ("pitch θ [deg]", np.degrees(1.0)),
    ("yaw ψ [deg]", np.degrees(1.0)),
]
_RATES: list[Panel] = [
    ("ẋ [m/s]", 1.0),
    ("ẏ [m/s]", 1.0),
    ("ż [m/s]", 1.0),
    ("φ̇ [deg/s]", np.degrees(1.0)),
    ("θ̇ [deg/s]", np.degrees(1.0)),
    ("ψ̇ [deg/s]", np.degrees(1.0)),
]
_BODY = ["surge X [N]", "sway Y [N]", "heave Z [N]", "roll K [N m]", "pitch M [N m]", "yaw N [N m]"]
_EARTH = ["along x [N]", "along y [N]", "along z [N]", "for φ [N m]", "for θ [N m]", "for ψ [N m]"]


def draw_way(page: Page, comparison: Comparison) -> None:
    """Draw energy against accuracy, the way back in space, and the pose."""
    draw_energy(page, comparison)
    draw_path(page, comparison.records, comparison.shown)
    draw_pose(page, comparison.records["learned"], comparison.shown)


def draw_effort(page: Page, comparison: Comparison, station: StationKeeping) -> None:
    """Draw the body wrench and, where there is a layout, what each thruster gives."""
    learned, optimal = comparison.records["learned"], comparison.shown
    draw_forces(page, learned, optimal, station, body=True)
    thrusters = station.model.vehicle.thrusters
    if thrusters is not None:
        draw_thrusters(page, learned, optimal, thrusters)


def draw_details(page: Page, comparison: Comparison, station: StationKeeping) -> None:
    """Draw the rates, and the control in the earth frame."""
    learned, optimal = comparison.records["learned"], comparison.shown
    draw_pose(page, learned, optimal, rates=True)
    draw_forces(page, learned, optimal, station, body=False)


def draw_pose(page: Page, learned: xr.Dataset, optimal: xr.Dataset, *, rates: bool = False) -> None:
    """Draw pose, or its rates, against time: learned beside optimal, or beside clairvoyant."""
    name, title = ("rates", "Rates") if rates else ("states", "Pose")
    first = 6 if rates else 0
    end = float(learned["time"][-1])
    with page.figure(name, f"{title}: learned beside {optimum_name(optimal)}", 2, 3, 5.2) as panels:
        for i, (axes, (label, unit)) in enumerate(zip(panels, _RATES if rates else _POSE, strict=True)):
            for record, color, run, style in pair(learned, optimal):
                values = unit * record["zeta"].values[:, first + i]
                axes.plot(record["time"], values, style, color=color, label=run)
            time_axis(axes, end)
            axes.set_title(label)
        legend_above(panels[0])


def draw_forces(
    page: Page, learned: xr.Dataset, optimal: xr.Dataset, station: StationKeeping, *, body: bool
) -> None:
    """Draw the control against time, in the body frame with what the thrusters can give, or in the
    earth frame, where R of the cost is constant.
    """
    title = (
        "Body wrench τ_b (in brackets: what the thrusters can give)"
        if body
        else "Earth-frame control u₁, which R of the cost weighs"
    )
    variable = "tau_b" if body else "u_control"
    thrusters = station.model.vehicle.thrusters
    end = float(learned["time"][-1])
    with page.figure("forces_body" if body else "forces_earth", title, 2, 3, 5.2) as panels:
        for i, (axes, label) in enumerate(zip(panels, _BODY if body else _EARTH, strict=True)):
            for record, color, name, style in pair(learned, optimal):
                time = record["time"] if record is learned else record["node"]
                axes.plot(time, record[variable].values[:, i], style, color=color, label=name)
            if body and thrusters is not None:
                label += _mark_limits(axes, *wrench_limits(thrusters, i))
            axes.set_title(label)
            time_axis(axes, end)
        legend_above(panels[0])


def draw_thrusters(page: Page, learned: xr.Dataset, optimal: xr.Dataset, thrusters: Thrusters) -> None:
    """Draw the thrust of every thruster, least-norm allocation, with its limits."""
    end = float(learned["time"][-1])
    runs = {
        name: (
            record["time" if record is learned else "node"],
            thrusters.thrust(record["tau_b"].values),
        )
        for record, _, name, _ in pair(learned, optimal)
    }
    reverse, forward = thrusters.limits
    share = max(float(np.maximum(t / forward, t / reverse).max()) for _, t in runs.values())
    title = f"Thrust: at most {share:.0%} of a thruster's limit is asked for"
    with page.figure("thrusters", title, 1, 2, 3.6) as panels:
        for axes, (name, (time, thrust)) in zip(panels, runs.items(), strict=True):
            for i, column in enumerate(thrust.T):
                axes.plot(time, column, color=line_color(i), lw=1.2, label=f"{i + 1}")
            axes.set_title(f"{name}: thrust [N]" + _mark_limits(axes, reverse, forward))
            time_axis(axes, end)
        legend_below(panels[0], columns=8, title="thruster")


def wrench_limits(thrusters: Thrusters, axis: int) -> tuple[float, float]:
    """Return the least and largest body force on one axis alone, the others zero [N or N m]."""
    allocation = thrusters.matrix
    unit = np.zeros(6)
    unit[axis] = 1.0
    bounds: Sequence[tuple[float | None, float | None]] = [
        *[thrusters.limits] * allocation.shape[1],
        (None, None),
    ]
    equations = np.column_stack([allocation, -unit])
    extremes = []
    for sign in (1.0, -1.0):
        cost = np.zeros(equations.shape[1])
        cost[-1] = sign
        answer = linprog(cost, A_eq=equations, b_eq=np.zeros(6), bounds=bounds)
        if answer.x is None:
            raise RunError(f"the wrench limits were not found ({answer.message})")
        extremes.append(float(answer.x[-1]))
    return extremes[0], extremes[1]


def _mark_limits(axes: Axes, low: float, high: float) -> str:
    """Draw limits that are near, and return words for the title."""
    bottom, top = axes.get_ylim()
    if low > 2.0 * bottom or high < 2.0 * top:
        for limit in (low, high):
            axes.axhline(limit, color="black", lw=1.0, ls=":")
    return f" ({low:.0f} … {high:.0f})"
