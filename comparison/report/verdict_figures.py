"""What a policy costs: against time, from many states, and in energy."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.ticker import StrMethodFormatter

from ...symbolic.arrays import Array
from ..merit import Regret, RunMetrics, cost_to_date
from ..policies import label_of
from ..study import Comparison
from .style import OPTIMAL, Page, colors_of, legend_below, time_axis


def draw_cost(page: Page, comparison: Comparison) -> None:
    """Draw the cost to date of each run, and how far it lies above the optimum's.

    Without the optimum that regret refers to the linear policy takes its place. The second panel is
    cut where policies end that are far worse than the linear one.
    """
    records, colors = comparison.records, colors_of(comparison.metrics)
    end = max(float(record["time"][-1]) for record in records.values())
    above, unit = _above(comparison)
    last = {name: float(values[-1]) for name, (_, values) in above.items() if len(values)}
    title = "Cost: " + ", ".join(f"{name} {last[name]:.2f} {unit}" for name in ("learned", "linear"))
    optimum, known = comparison.reference.name, comparison.reference.known
    reference = f"the {optimum}'s" if known else "the linear policy's"
    with page.figure("cost", f"{title} above {reference}", 1, 2, 4.4) as (total, excess):
        for name, record in records.items():
            early = comparison.metrics[name].stopped
            outcome = "ended early" if early else f"{last.get(name, np.nan):.2f} {unit}"
            label = f"{label_of(name)}, {outcome}"
            layer = 3 if name == "learned" else 2
            total.plot(
                record["time"], cost_to_date(record), label=label, color=colors[name], zorder=layer
            )
            excess.plot(*above[name], color=colors[name], zorder=layer)
        if known:
            best = comparison.shown
            total.plot(best["time"], best["cost"], "--", color=OPTIMAL, label=optimum, zorder=4)
            excess.axhline(0.0, color=OPTIMAL, ls="--")
        far = 3.0 * max(abs(last["linear"]), abs(last["learned"]), 0.1)
        near = [values for _, values in above.values() if len(values) and abs(values[-1]) < far]
        excess.set_ylim(*_limits(np.concatenate(near)))
        total.set_title("Cost to date [-]")
        excess.set_title(f"Above {reference} cost to date [{unit if unit == '%' else '-'}]")
        for axes in (total, excess):
            time_axis(axes, end)
        legend_below(total, columns=3)


def _limits(values: Array) -> tuple[float, float]:
    low, high = float(values.min()), float(np.quantile(values, 0.999))
    return low - 0.05 * (high - low), high + 0.2 * (high - low) + 1e-12


def draw_regrets(page: Page, comparison: Comparison) -> None:
    """Draw the regret of each policy from every state, with its median."""
    found = {name: regrets for name, regrets in comparison.regrets.items() if len(regrets) > 1}
    found = found or comparison.regrets
    count, colors = comparison.n_states, colors_of(comparison.metrics)
    states = "one state" if count == 1 else f"{count} states"
    title = f"Regret from {states}: how much dearer than the {comparison.reference.name}"
    with page.figure("regret", title, 1, 1, 0.42 * len(found) + 1.6) as (axes,):
        for row, (name, regrets) in enumerate(found.items()):
            percent = 100.0 * np.array([r for r in regrets if r is not None and r > 0.0])
            spread = np.linspace(-0.22, 0.22, len(percent)) if len(percent) > 1 else [0.0]
            axes.plot(percent, row + np.array(spread[: len(percent)]), "o", color=colors[name], ms=4)
            label = label_of(name)
            middle = 100.0 * Regret.of(regrets).median
            if 0.0 < middle < math.inf:
                axes.plot([middle] * 2, [row - 0.36, row + 0.36], color="black", lw=2.0)
                label += f", {middle:.2g} %" if middle < 100.0 else f", {middle:.0f} %"
            lost = sum(r is None for r in regrets)
            axes.text(0.01, row + 0.28, label, transform=axes.get_yaxis_transform(), fontsize=8)
            if lost:
                words = f"{lost} of {len(regrets)} ended early"
                axes.text(
                    0.99, row, words, transform=axes.get_yaxis_transform(), ha="right", fontsize=8
                )
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.set_ylim(len(found) - 0.4, -0.6)
        axes.set_yticks([])
        axes.set_xlabel("regret [%], bar and number: median")
        low, high = axes.get_xlim()
        axes.set_xlim(low / (high / low) ** 0.45, high)


def draw_energy(page: Page, comparison: Comparison) -> None:
    """Draw what each policy needs against how well it holds the station, relative to the linear one.

    From each state the quotients of energy, or of effort where the power of the thrusters is not known,
    and of the rms distance; medians, and 10 to 90 % of the states.
    """
    colors = colors_of(comparison.metrics)
    electrical = all(run.energy is not None for runs in comparison.all_metrics.values() for run in runs)
    with page.figure("energy", "Energy against accuracy, linear H-infinity = 1", 1, 1, 4.2) as (axes,):
        for name, runs in comparison.all_metrics.items():
            pairs = [
                (
                    _needed(run, electrical) / _needed(one, electrical),
                    run.position_rms / one.position_rms,
                )
                for run, one in zip(runs, comparison.all_metrics["linear"], strict=False)
                if run.position_rms and one.position_rms and not (run.stopped or one.stopped)
            ]
            if not pairs:
                continue
            low, middle, high = np.quantile(pairs, [0.1, 0.5, 0.9], axis=0)
            bars = np.stack([middle - low, high - middle])
            axes.errorbar(
                middle[0],
                middle[1],
                xerr=bars[:, :1],
                yerr=bars[:, 1:],
                fmt="o",
                ms=7,
                elinewidth=0.8,
                color=colors[name],
                label=label_of(name) + ("" if len(pairs) == len(runs) else " *"),
            )
        axes.set_xlabel("electrical energy [-]" if electrical else "effort ∫|force|² dt [-]")
        axes.set_ylabel("distance from the station, rms [-]")
        axes.set_title("Down and to the left is better (*: runs that ended early are left out)")
        legend_below(axes, columns=4)


def _needed(run: RunMetrics, electrical: bool) -> float:
    found = run.energy if electrical else run.effort
    return math.nan if found is None else found


def _above(comparison: Comparison) -> tuple[dict[str, tuple[Array, Array]], str]:
    """Return times and cost to date above the reference's, for each run, and the unit."""
    records = comparison.records
    if comparison.reference.known:
        optimal = comparison.shown
        time, cost = optimal["time"].values, optimal["cost"].values
        factor, unit = 100.0 / float(optimal.attrs["value"]), "%"
    else:
        time, cost = records["linear"]["time"].values, cost_to_date(records["linear"])
        factor, unit = 1.0, "units"
    above = {}
    for name, record in records.items():
        own = record["time"].values
        above[name] = (own, np.asarray(factor * (cost_to_date(record) - np.interp(own, time, cost))))
    return above, unit
