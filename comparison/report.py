"""A self-contained HTML report: what was asked, what came out, how sure it is, how to do it again."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from ..online.record import write_text
from .compare import Comparison
from .contenders import CONTENDERS

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1b1b1b; max-width: 60rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
img { width: 100%; height: auto; border: 1px solid #ddd; margin: .4rem 0 1.2rem; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; }
.wide { overflow-x: auto; }
th, td { text-align: left; padding: .3rem .7rem .3rem 0; border-bottom: 1px solid #ddd;
         vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
pre { background: #f4f4f4; padding: .8rem; overflow-x: auto; font-size: .85rem; }
.lead { font-size: 1.15rem; } .fault { color: #a31515; }
"""

CAPTIONS = {
    "states": "Pose on the way back to the station, under the learned and under the optimal policy.",
    "rates": "The rates on the same way.",
    "forces_body": "Body wrench that the thrusters are asked for, with what they can give on each axis "
    "alone.",
    "forces_earth": "Earth-frame control u₁. The cost weighs this, J⁻ᵀτ_b, and not the body effort.",
    "thrusters": "Thrust of each thruster, least-norm allocation.",
    "cost": "Cost to date, and how far it lies above the optimum's.",
    "weights": "The critic's weights while it learns, from the Riccati solution on.",
    "bellman": "The Bellman error (17) at the samples and at the state, and the rank margin of (18).",
    "excitation": "The paper's claim: with sample points the weights converge although the trajectory "
    "excites only a few directions; without, they stay where they were or the run is lost. The right "
    "weights are known exactly for the linearised vehicle.",
}


def write_report(
    path: Path, comparison: Comparison, figures: dict[str, Path], commands: Sequence[str]
) -> Path:
    """Write the report, figures embedded; raises InputError if the folder can't be written."""
    name = comparison.station.model.vehicle.name
    body = [
        f"<h1>Station keeping of {escape(name)}: learned beside optimal</h1>",
        f'<p class="lead">{escape(verdict(comparison))}</p>',
        *[f'<p class="fault">{escape(too_short(comparison))}</p>' for _ in comparison.too_short[:1]],
        *[f'<p class="fault">{escape(fault)}</p>' for fault in comparison.faults],
        _asked(comparison),
        "<h2>What came out</h2>",
        _table(*summary(comparison)),
        *[_figure(key, figure) for key, figure in figures.items()],
        "<h2>How sure it is</h2>",
        _table(*certificate(comparison)),
        "<h2>The paper's conditions</h2>",
        _table(*conditions(comparison)),
        "<h2>Do it again</h2>",
        f"<pre>{escape(chr(10).join(commands))}</pre>",
        f"<pre>{escape(comparison.scenario.model_dump_json(indent=1))}</pre>",
    ]
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(name)}: learned beside optimal</title><style>{_STYLE}</style></head>"
        f"<body>{''.join(body)}</body></html>"
    )
    return write_text(path, page)


def verdict(comparison: Comparison) -> str:
    """Return the outcome in one sentence."""
    if comparison.regret is None:
        return "With a real disturbance the game's optimum is no reference: there is no regret."
    learned, linear = (comparison.regret[name]["median"] for name in ("learned", "linear"))
    if learned is None or linear is None:
        return "A run ended early, so there is no regret to compare."
    change = 100 * (learned - linear) / linear
    outcome = f"takes {-change:.0f} % off" if change < 0 else f"adds {change:.0f} % to"
    states = "" if comparison.n_states == 1 else f" (median of {comparison.n_states} states)"
    return (
        f"The learned policy costs {100 * learned:.2f} % more than the optimum{states}; the linear "
        f"H-infinity policy, which learns nothing, {100 * linear:.2f} %: learning {outcome} the excess."
    )


def too_short(comparison: Comparison) -> str:
    """Return a warning that some runs end while their cost still grows."""
    return (
        f"The runs are too short for a regret of {', '.join(comparison.too_short)}: more than 0.1 % of "
        "the cost is the estimate ζ'P ζ for the rest; raise simulation.duration."
    )


def summary(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the summary: one row a policy."""
    columns = "policy, cost, regret [%], position rms [m], effort [N² s], peak thrust [%], ended early"
    header = columns.split(", ")
    rows = []
    for name, metrics in comparison.metrics.items():
        rows.append(
            [
                CONTENDERS[name].label,
                _number(metrics.cost, ".4f"),
                _number(metrics.regret, ".3f", 100.0),
                _number(metrics.position_rms, ".3f"),
                _number(metrics.effort, ".1f"),
                _number(metrics.peak_thrust, ".0f", 100.0),
                metrics.stopped or "no",
            ]
        )
    rows.append(
        ["offline optimum", f"{comparison.optimal.attrs['value']:.4f}", "0.000", "", "", "", ""]
    )
    return header, rows


def certificate(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the optimum's certificate."""
    attributes = comparison.optimal.attrs
    meanings = {
        "value_error": "relative error of the value: mesh, re-integration, horizon and saddle point",
        "defect": "gap of the re-integrated trajectory, in half-widths",
        "hji_residual": "residual of the HJI (7), relative to the state cost",
        "costate_error": "costate against a finite difference of the value, relative",
        "horizon_error": "relative change of the value when the horizon doubles",
    }
    rows = [[key, f"{attributes[key]:.1e}", meaning] for key, meaning in meanings.items()]
    return ["certificate", "value", "meaning"], rows


def conditions(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the paper's conditions."""
    words = {True: "yes", False: "no", None: "not known"}
    rows = [
        [c.name, c.paper, _number(c.value, ".4g"), _number(c.bound, ".4g"), words[c.holds], c.note]
        for c in comparison.conditions
    ]
    return ["condition", "paper", "value", "bound", "holds", "note"], rows


def _asked(comparison: Comparison) -> str:
    scenario = comparison.scenario
    state = ", ".join(f"{value:g}" for value in scenario.simulation.initial_state)
    return (
        "<h2>What was asked</h2><p>From the state "
        f"({escape(state)}) [m, rad, m/s, rad/s] the vehicle goes back to its station. The cost weighs "
        "position, attitude and control, against a disturbance that pays γ² for its effort "
        f"(γ = {scenario.game.gamma:g}). The learner has {comparison.station.basis.n_basis} basis "
        f"functions and {scenario.samples.number} sample points, starts from the linear H-infinity "
        "policy, and learns only during this run. The optimum of the same game is solved offline.</p>"
    )


def _figure(key: str, path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    caption = escape(CAPTIONS[key])
    return f'<p>{caption}</p><img alt="{caption}" src="data:image/png;base64,{data}">'


def _table(header: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    rows = list(rows)
    numeric = [_is_number(cell) for cell in rows[0]] if rows else []
    head = "".join(
        f'<th class="number">{escape(cell)}</th>' if number else f"<th>{escape(cell)}</th>"
        for cell, number in zip(header, numeric, strict=True)
    )
    lines = "".join(f"<tr>{''.join(_cell(cell) for cell in row)}</tr>" for row in rows)
    return f'<div class="wide"><table><tr>{head}</tr>{lines}</table></div>'


def _cell(text: str) -> str:
    if _is_number(text):
        return f'<td class="number">{escape(text)}</td>'
    return f"<td>{escape(text)}</td>"


def _is_number(text: str) -> bool:
    return text[:1].isdigit() or text[:1] == "-"


def _number(value: float | None, form: str, factor: float = 1.0) -> str:
    return "–" if value is None else f"{factor * value:{form}}"
