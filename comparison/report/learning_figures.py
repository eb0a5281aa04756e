"""What was learned: weights, errors along the way and around it, and the paper's claim."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter

from ...symbolic.arrays import Array
from ..study import ExcitationRun
from .style import LEARNED, LINEAR, OPTIMAL, Page, legend_below, line_color, time_axis

SCIENTIFIC = FuncFormatter(lambda value, _: f"{value:.1e}" if value else "0")
ERRORS = {
    "bellman": "rms of δ / ζ'Qζ over the samples [-]",
    "costate": "root of the relative regret [-]",
}


def draw_weights(
    page: Page, learned: xr.Dataset, riccati: Array, analysis: xr.Dataset, *, shown: int = 8
) -> None:
    """Draw the critic weights that moved most beside Riccati's and the ideal ones W*.

    W* is the best fit of the basis to the optimum over the whole envelope (`analysis`); the weights
    follow the run, and need not be near it.
    """
    critic, ideal = learned["critic"].values, analysis["ideal_weights"].values
    time, m = learned["learn_time"].values, critic.shape[1]
    moved = np.argsort(-np.abs(critic[-1] - riccati))[:shown]
    with page.figure("weights", "Weights of critic and actors", 1, 2, 4.2) as (values, distance):
        for k, i in enumerate(moved):
            color = line_color(k)
            values.plot(time, critic[:, i], color=color, label=f"w{i + 1}")
            values.axhline(riccati[i], color=color, lw=0.8, ls="--")
            values.axhline(ideal[i], color=color, lw=0.8, ls=":")
        values.set_title(f"{len(moved)} of {m} that moved most (dashed: Riccati, dotted: W*)")
        values.set_ylabel("critic weight")
        low, high = critic[:, moved].min(), critic[:, moved].max()
        values.set_ylim(low - 0.4 * (high - low), high + 0.4 * (high - low))
        values.legend(ncols=4, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16))
        scale = float(np.linalg.norm(riccati))
        for name, label, color, style in (
            ("critic", "critic", LEARNED, "-"),
            ("actor_1", "control actor", OPTIMAL, "-"),
            ("actor_2", "disturbance actor", "#28a197", "--"),
        ):
            gap = np.linalg.norm(learned[name].values - riccati, axis=1) / scale
            distance.plot(time, 100 * gap, style, color=color, label=label)
        away = 100 * float(np.linalg.norm(riccati - ideal)) / scale
        distance.set_title(f"Distance from Riccati's weights [%] (W*: {away:.0f} %)")
        distance.set_ylim(bottom=0.0)
        distance.legend(ncols=3, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16))
        for axes in (values, distance):
            time_axis(axes, float(time[-1]))


def draw_errors(page: Page, analysis: xr.Dataset, moving: str) -> None:
    """Draw the errors of value and policy along the learned trajectory, beside the linear ones.

    `moving`: what is in the states.
    """
    time = analysis["time"].values
    title = f"Against the optimum from the very state that the {moving} is in"
    with page.figure("errors", title, 1, 2, 3.8) as panels:
        for axes, kind, label in zip(
            panels,
            ("value", "policy"),
            ("|V̂ - V*| / V* [%]", "|u₁ - u₁*| / |u₁*|, in the norm of R [%]"),
            strict=True,
        ):
            for name, color in (("learned", LEARNED), ("linear", LINEAR)):
                axes.plot(time, 100.0 * analysis[f"{kind}_error_{name}"], color=color, label=name)
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.set_title(("Value: " if kind == "value" else "Control: ") + label)
            time_axis(axes, float(time[-1]))
        legend_below(panels[0], columns=2)


def draw_field(page: Page, analysis: xr.Dataset, moving: str) -> None:
    """Draw the Bellman error over two states around a moment, with Riccati's and learned weights.

    `moving`: what is in the states.
    """
    rows, columns = (str(analysis.attrs[f"field_{side}"]) for side in ("rows", "columns"))
    fields = {name: np.abs(analysis[f"field_{name}"].values) for name in ("linear", "learned")}
    both = np.concatenate([values.ravel() for values in fields.values()])
    low = max(float(np.nanquantile(both, 0.02)), 1e-12)  # NaN at the origin itself
    norm = LogNorm(low, max(float(np.nanmax(both)), 10.0 * low))
    moment = float(analysis.attrs["field_time"])
    title = f"Bellman error around the {moving} at t = {moment:.1f} s"
    with page.figure("field", title, 1, 2, 4.0) as panels:
        for axes, (name, values) in zip(panels, fields.items(), strict=True):
            x, y = analysis["column"].values, analysis["row"].values
            mesh = axes.pcolormesh(x, y, values, norm=norm, cmap="cividis", shading="nearest")
            mesh.set_rasterized(True)
            axes.plot(analysis["way_columns"], analysis["way_rows"], color="white", lw=1.2)
            axes.plot(*(analysis.attrs[f"field_{k}_value"] for k in ("columns", "rows")), "wo", ms=5)
            axes.set_xlim(x[0], x[-1])
            axes.set_ylim(y[0], y[-1])
            axes.set_xlabel(columns)
            axes.set_ylabel(rows)
            axes.set_title({"linear": "Riccati's weights", "learned": "learned weights"}[name])
            axes.figure.colorbar(mesh, ax=axes, label="|δ| / (ζ'Qζ) [-]")


def draw_bellman(page: Page, learned: xr.Dataset, error: str) -> None:
    """Draw the error that is learned from, and δ at the state.

    `error`: `learner.error` of the run, which says what the first of them is.
    """
    time = learned["learn_time"].values
    with page.figure("bellman", "What is learned from, and the Bellman error", 1, 2, 3.4) as panels:
        samples, state = panels
        samples.plot(time, learned["sample_error"], color=LEARNED)
        samples.set_title(ERRORS[error])
        samples.set_ylim(bottom=0.0)
        state.plot(time, np.abs(learned["bellman_error"]), color=LEARNED)
        state.set_yscale("log")
        state.set_title("|δ| at the state [cost/s]")
        for axes in panels:
            time_axis(axes, float(time[-1]))


def draw_excitation(page: Page, runs: dict[str, list[ExcitationRun]]) -> None:
    """Draw excitation, rank margin and weight error without and with samples, one row a plant."""
    title = "No persistence of excitation: with and without sample points (x: left the envelope)"
    with page.figure("excitation", title, len(runs), 3, 2.6 * len(runs) + 0.6) as panels:
        for row, (plant, group) in enumerate(runs.items()):
            excited, margin, error = panels[3 * row : 3 * row + 3]
            # the first is wider: the second may lie on it
            for run, color, width in zip(
                group, (LINEAR, OPTIMAL, LEARNED), (3.2, 1.6, 1.6), strict=True
            ):
                excited.plot(run.time, run.excited, color=color, lw=width, label=run.name)
                margin.plot(run.time, run.rank_margin, color=color, lw=width)
                error.semilogy(run.time, run.weight_error, color=color, lw=width)
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
                time_axis(axes, max(float(run.time[-1]) for run in group))
        legend_below(panels[0], columns=3)
