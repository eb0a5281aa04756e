"""The figures of a comparison, one message a figure; here states and controls of any problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import xarray as xr

from ...symbolic import StationKeeping
from ...symbolic.arrays import Array
from ..records import optimum_name
from ..study import Comparison, quantity, subject
from .learning_figures import draw_bellman, draw_errors, draw_excitation, draw_field, draw_weights
from .monitor_figure import draw_monitor
from .style import Page, line_color, pair, time_axis
from .vehicle_figures import draw_details, draw_effort, draw_way
from .verdict_figures import draw_cost, draw_regrets

LARGEST = 6  # lines of one colour each in a panel


def draw_all(comparison: Comparison, page: Page) -> None:
    """Draw every figure of a comparison on `page`, in the order in which a report shows them."""
    setup, learned = comparison.setup, comparison.records["learned"]
    analysis, moving = comparison.analysis, subject(comparison.setup)
    station = setup if isinstance(setup, StationKeeping) else None
    if comparison.regret is not None:
        draw_regrets(page, comparison)
    if station is None:
        draw_states(page, comparison)
    else:
        draw_way(page, comparison)
    draw_cost(page, comparison)
    if station is None:
        draw_controls(page, comparison)
    else:
        draw_effort(page, comparison, station)
    draw_errors(page, analysis, moving)
    draw_weights(page, learned, setup.riccati_weights, analysis)
    draw_bellman(page, learned, comparison.scenario.learner.error)
    draw_monitor(page, learned, comparison.theory)
    if "field_learned" in analysis:
        draw_field(page, analysis, moving)
    draw_excitation(page, comparison.excitation)
    if station is not None:
        draw_details(page, comparison, station)


def draw_states(page: Page, comparison: Comparison) -> None:
    """Draw all states against time, a panel for each unit: learned beside the optimum."""
    problem, learned = comparison.setup.problem, comparison.records["learned"]
    runs = {style: (run["time"].values, run["zeta"].values) for run, style in _both(comparison)}
    title = f"States: learned (solid) beside {optimum_name(comparison.shown)} (dashed)"
    labels = list(zip(problem.state_names, problem.state_units, strict=True))
    draw_lines(page, "states", title, labels, runs, float(learned["time"][-1]))


def draw_controls(page: Page, comparison: Comparison) -> None:
    """Draw all inputs of the control against time, as `draw_states` does."""
    problem, learned = comparison.setup.problem, comparison.records["learned"]
    runs = {
        style: (run["time" if run is learned else "node"].values, run["u_control"].values)
        for run, style in _both(comparison)
    }
    title = f"Control u₁: learned (solid) beside {optimum_name(comparison.shown)} (dashed)"
    labels = list(zip(problem.input_names, problem.input_units, strict=True))
    draw_lines(page, "controls", title, labels, runs, float(learned["time"][-1]))


def _both(comparison: Comparison) -> list[tuple[xr.Dataset, str]]:
    return [
        (record, style) for record, _, _, style in pair(comparison.records["learned"], comparison.shown)
    ]


def draw_lines(
    page: Page,
    name: str,
    title: str,
    labels: Sequence[tuple[str, str]],
    runs: Mapping[str, tuple[Array, Array]],
    end: float,
) -> None:
    """Draw columns of numbers against time, those of one unit in a panel, at most six.

    Parameters
    ----------
    labels : name and unit of each column
    runs : times (T,) and numbers (T, columns) by the style of line
    end : of the axis of time [s]
    """
    groups = groups_by_unit([unit for _, unit in labels])
    columns = min(2, len(groups))
    rows = -(-len(groups) // columns)
    with page.figure(name, title, rows, columns, 3.4 * rows) as panels:
        for axes, group in zip(panels, groups, strict=False):
            for color, i in enumerate(group):
                for style, (time, values) in runs.items():
                    label = labels[i][0] if style == "-" else None
                    axes.plot(time, values[:, i], style, color=line_color(color), label=label)
            axes.set_title(quantity(", ".join(labels[i][0] for i in group), labels[group[0]][1]))
            axes.legend(fontsize=7, ncols=3)
            time_axis(axes, end)
        for axes in panels[len(groups) :]:
            axes.set_visible(False)


def groups_by_unit(units: Sequence[str]) -> list[list[int]]:
    """Return the numbers of like units together, in the order of first appearance, at most six each."""
    found: dict[str, list[int]] = {}
    for i, unit in enumerate(units):
        found.setdefault(unit, []).append(i)
    return [
        members[i : i + LARGEST] for members in found.values() for i in range(0, len(members), LARGEST)
    ]
