"""The figures of a comparison: learned beside optimal, one message a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter
from scipy.optimize import linprog

from ..symbolic import RunError, StationKeeping, Thrusters
from ..symbolic.vehicle import Array
from .compare import Comparison
from .excitation import ExcitationRun
from .metrics import cost_to_date
from .style import LEARNED, LINEAR, OPTIMAL, PALETTE, figure, legend_above, legend_below

Panel = tuple[str, float]
SCIENTIFIC = FuncFormatter(lambda value, _: f"{value:.1e}" if value else "0")
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


def draw_all(comparison: Comparison, folder: Path) -> dict[str, Path]:
    """Draw every figure of a comparison into `folder`; returns their paths by name."""
    station, optimal = comparison.station, comparison.optimal
    learned, linear = comparison.records["learned"], comparison.records["linear"]

    def at(name: str) -> Path:
        return folder / f"{name}.png"

    figures = {
        "states": draw_states(at("states"), learned, optimal),
        "cost": draw_cost(at("cost"), {"linear": linear, "learned": learned}, optimal),
        "forces_body": draw_forces(at("forces_body"), learned, optimal, station, body=True),
        "forces_earth": draw_forces(at("forces_earth"), learned, optimal, station, body=False),
        "rates": draw_states(at("rates"), learned, optimal, rates=True),
        "weights": draw_weights(at("weights"), learned, station.riccati_weights),
        "bellman": draw_bellman(at("bellman"), learned, comparison.scenario.learner.error),
        "excitation": draw_excitation(at("excitation"), comparison.excitation),
    }
    thrusters = station.model.vehicle.thrusters
    if thrusters is not None:
        figures["thrusters"] = draw_thrusters(at("thrusters"), learned, optimal, thrusters)
    return figures


def draw_states(path: Path, learned: xr.Dataset, optimal: xr.Dataset, *, rates: bool = False) -> Path:
    """Draw pose, or its rates, against time: learned beside optimal."""
    title = "Rates: learned beside optimal" if rates else "Pose: learned beside optimal"
    first = 6 if rates else 0
    end = float(learned["time"][-1])
    with figure(path, title, 2, 3, 5.2) as panels:
        for i, (axes, (label, unit)) in enumerate(zip(panels, _RATES if rates else _POSE, strict=True)):
            for record, color, name, style in _pair(learned, optimal):
                values = unit * record["zeta"].values[:, first + i]
                axes.plot(record["time"], values, style, color=color, label=name)
            _time_axis(axes, end)
            axes.set_title(label)
        legend_above(panels[0])
    return path


def draw_forces(
    path: Path, learned: xr.Dataset, optimal: xr.Dataset, station: StationKeeping, *, body: bool
) -> Path:
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
    with figure(path, title, 2, 3, 5.2) as panels:
        for i, (axes, label) in enumerate(zip(panels, _BODY if body else _EARTH, strict=True)):
            for record, color, name, style in _pair(learned, optimal):
                time = record["time"] if record is learned else record["node"]
                axes.plot(time, record[variable].values[:, i], style, color=color, label=name)
            if body and thrusters is not None:
                label += _mark_limits(axes, *wrench_limits(thrusters, i))
            axes.set_title(label)
            _time_axis(axes, end)
        legend_above(panels[0])
    return path


def draw_thrusters(path: Path, learned: xr.Dataset, optimal: xr.Dataset, thrusters: Thrusters) -> Path:
    """Draw the thrust of every thruster, least-norm allocation, with its limits."""
    end = float(learned["time"][-1])
    runs = {
        name: (
            record["time" if record is learned else "node"],
            thrusters.thrust(record["tau_b"].values),
        )
        for record, _, name, _ in _pair(learned, optimal)
    }
    reverse, forward = thrusters.limits
    share = max(float(np.maximum(t / forward, t / reverse).max()) for _, t in runs.values())
    title = f"Thrust: at most {share:.0%} of a thruster's limit is asked for"
    with figure(path, title, 1, 2, 3.6) as panels:
        for axes, (name, (time, thrust)) in zip(panels, runs.items(), strict=True):
            for i, column in enumerate(thrust.T):
                axes.plot(time, column, color=line_color(i), lw=1.2, label=f"{i + 1}")
            axes.set_title(f"{name}: thrust [N]" + _mark_limits(axes, reverse, forward))
            _time_axis(axes, end)
        legend_below(panels[0], columns=8, title="thruster")
    return path


def draw_weights(path: Path, learned: xr.Dataset, riccati: Array, *, shown: int = 8) -> Path:
    """Draw the critic weights that moved most, with the Riccati values they started from."""
    critic = learned["critic"].values
    moved = np.argsort(-np.abs(critic[-1] - riccati))[:shown]
    time = learned["learn_time"].values
    m = critic.shape[1]
    title = "Weights of critic and actors"
    with figure(path, title, 1, 2, 4.2) as (values, distance):
        for k, i in enumerate(moved):
            color = line_color(k)
            values.plot(time, critic[:, i], color=color, label=f"w{i + 1}")
            values.axhline(riccati[i], color=color, lw=0.8, ls="--")
        values.set_title(f"The {shown} of {m} weights that moved most (dashed: Riccati)")
        values.set_ylabel("critic weight")
        values.legend(ncols=4, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16))
        scale = np.linalg.norm(riccati)
        for name, label, color, style in (
            ("critic", "critic", LEARNED, "-"),
            ("actor_1", "control actor", OPTIMAL, "-"),
            ("actor_2", "disturbance actor", "#28a197", "--"),
        ):
            gap = np.linalg.norm(learned[name].values - riccati, axis=1) / scale
            distance.plot(time, 100 * gap, style, color=color, label=label)
        distance.set_title("Distance from the Riccati weights [%]")
        distance.set_ylim(bottom=0.0)
        distance.legend(ncols=3, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16))
        for axes in (values, distance):
            _time_axis(axes, float(time[-1]))
    return path


ERRORS = {
    "bellman": "rms of δ / ζ'Qζ over the samples [-]",
    "costate": "root of the relative regret [-]",
}


def draw_bellman(path: Path, learned: xr.Dataset, error: str) -> Path:
    """Draw the error that is learned from and δ at the state, and the rank margin of (18).

    `error`: `learner.error` of the run, which says what the first of them is.
    """
    time = learned["learn_time"].values
    with figure(path, "Bellman error and rank margin", 1, 3, 3.4) as panels:
        samples, state, margin = panels
        samples.plot(time, learned["sample_error"], color=LEARNED)
        samples.set_title(ERRORS[error])
        samples.set_ylim(bottom=0.0)
        state.plot(time, np.abs(learned["bellman_error"]), color=LEARNED)
        state.set_yscale("log")
        state.set_title("|δ| at the state [cost/s]")
        monitored = np.isfinite(learned["rank_margin"].values)
        margin.plot(time[monitored], learned["rank_margin"].values[monitored], color=OPTIMAL)
        margin.set_ylim(bottom=0.0)
        margin.set_title("rank margin of (18), λ_min [-]")
        margin.yaxis.set_major_formatter(SCIENTIFIC)
        for axes in panels:
            _time_axis(axes, float(time[-1]))
    return path


def draw_cost(path: Path, records: dict[str, xr.Dataset], optimal: xr.Dataset) -> Path:
    """Draw the cost to date of each run, and how far it lies above the optimum's."""
    colors = {"learned": LEARNED, "linear": LINEAR}
    end = max(float(record["time"][-1]) for record in records.values())
    ends = {name: _excess(record, optimal)[1][-1] for name, record in records.items()}
    title = "Cost above the optimum: " + ", ".join(f"{_label(n)} {e:.2f} %" for n, e in ends.items())
    with figure(path, title, 1, 2, 3.8) as (total, excess):
        total.plot(optimal["time"], optimal["cost"], "--", color=OPTIMAL, label="optimal", zorder=3)
        for name, record in records.items():
            time = record["time"].values
            cost = cost_to_date(record)
            total.plot(time, cost, color=colors[name], label=_label(name))
            excess.plot(*_excess(record, optimal), color=colors[name], label=_label(name))
        total.set_title("Cost to date [-]")
        excess.set_title("Above the optimum's cost to date [% of V*]")
        excess.axhline(0.0, color=OPTIMAL, ls="--", label="optimal")
        for axes in (total, excess):
            _time_axis(axes, end)
            axes.legend()
    return path


def draw_excitation(path: Path, runs: dict[str, list[ExcitationRun]]) -> Path:
    """Draw excitation, rank margin and weight error without and with samples, one row a plant."""
    title = "No persistence of excitation: with and without sample points (x: left the envelope)"
    with figure(path, title, len(runs), 3, 2.6 * len(runs) + 0.6) as panels:
        for row, (plant, group) in enumerate(runs.items()):
            excited, margin, error = panels[3 * row : 3 * row + 3]
            for run, color in zip(group, (LINEAR, OPTIMAL, LEARNED), strict=True):
                excited.plot(run.time, run.excited, color=color, label=run.name)
                margin.plot(run.time, run.rank_margin, color=color)
                error.semilogy(run.time, run.weight_error, color=color)
                if run.stopped:
                    for axes, series in ((excited, run.excited), (error, run.weight_error)):
                        axes.plot(run.time[-1], series[-1], "x", color="black", ms=7, mew=2)
            m = group[0].n_basis
            excited.set_title(f"excited directions, of {m}")
            excited.set_ylabel(plant, fontweight="bold")
            excited.set_ylim(0, m)
            margin.set_title("rank margin of (18) [-]")
            margin.yaxis.set_major_formatter(SCIENTIFIC)
            error.set_title("weight error |Ŵ - W*| / |W*| [-]")
            for axes in (excited, margin, error):
                _time_axis(axes, max(float(run.time[-1]) for run in group))
        legend_below(panels[0], columns=3)
    return path


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


def line_color(index: int) -> str:
    """Return the colour of the i-th of several like lines."""
    return (*PALETTE, "#b0a18f", "#4d9de0")[index % (len(PALETTE) + 2)]


def _pair(learned: xr.Dataset, optimal: xr.Dataset) -> list[tuple[xr.Dataset, str, str, str]]:
    return [(learned, LEARNED, "learned", "-"), (optimal, OPTIMAL, "optimal", "--")]


def _label(name: str) -> str:
    return {"linear": "linear H-infinity"}.get(name, name)


def _excess(record: xr.Dataset, optimal: xr.Dataset) -> tuple[Array, Array]:
    """Return times and the cost to date above the optimum's, in percent of V*."""
    time = record["time"].values
    cost = cost_to_date(record)
    reference = np.interp(time, optimal["time"].values, optimal["cost"].values)
    return time, np.asarray(100.0 * (cost - reference) / float(optimal.attrs["value"]))


def _mark_limits(axes: Axes, low: float, high: float) -> str:
    """Draw limits that are near, and return words for the title."""
    bottom, top = axes.get_ylim()
    if low > 2.0 * bottom or high < 2.0 * top:
        for limit in (low, high):
            axes.axhline(limit, color="black", lw=1.0, ls=":")
    return f" ({low:.0f} … {high:.0f})"


def _time_axis(axes: Axes, end: float) -> None:
    axes.set_xlim(0.0, end)
    axes.set_xlabel("time [s]")
