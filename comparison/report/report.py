"""A self-contained HTML report: what was asked, what came out, how sure it is, how to do it again."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from ...online.records import write_text
from ..study import Comparison
from .report_tables import certificate, clairvoyant_check, conditions, summary, too_short, verdict
from .style import Page

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.55 system-ui, sans-serif; color: #1b1b1b; max-width: 60rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; line-height: 1.25; } h2 { font-size: 1.25rem; margin-top: 2.4rem; }
h1, p, li, figcaption, summary { overflow-wrap: break-word; }
figure { margin: 1.6rem 0; } figcaption { margin-bottom: .4rem; }
img { width: 100%; height: auto; border: 1px solid #ddd; display: block; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; }
.wide { overflow-x: auto; }
th, td { text-align: left; padding: .3rem .7rem .3rem 0; border-bottom: 1px solid #ddd;
         vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
pre { background: #f4f4f4; padding: .8rem; overflow-x: auto; font-size: .85rem; }
summary { cursor: pointer; font-weight: 600; margin: .8rem 0; }
.lead { font-size: 1.15rem; } .fault { color: #a31515; }
@media (max-width: 640px) { body { margin: 1rem auto; } h1 { font-size: 1.35rem; } }
"""

CAPTIONS = {
    "regret": "Regret is how much more than the optimum a policy costs, from the same state. Each dot "
    "is one initial state.",
    "energy": "What it takes to hold the station, against how well it is held. Energy is that of "
    "the thrusters where their power is known.",
    "path": "The way back in space and from above.",
    "states": "The pose on the way back, under the learned policy and at the optimum.",
    "rates": "The rates on the same way.",
    "forces_body": "Wrench that the thrusters are asked for, with what they can give on each axis "
    "alone.",
    "forces_earth": "Control in the earth frame. The cost weighs this, J⁻ᵀτ_b, not the body effort.",
    "thrusters": "Thrust of each thruster, with the least sum of squares.",
    "cost": "Cost so far, and how far it lies above.",
    "errors": "At each moment the optimum is solved again from the state that the vehicle is in: how "
    "far off the learned value and control are there, and how far the linear ones.",
    "weights": "The weights of the value while it is learned. W* fits the optimum best over the "
    "whole envelope; the learner fits the way that the vehicle is on, so it need not end there.",
    "bellman": "The error that is learned from, and the Bellman error at the state.",
    "monitor": "What the proof asks for along the learned run: (18) at fixed samples under the policy "
    "of the moment; in how many directions what is learned from outweighs the leash; the "
    "regressors; the bound on the weights; how far the policies are from the value; and the "
    "proof's V_L.",
    "field": "How well the equation of the optimum (HJI) is met around the vehicle (dot), over two of "
    "its twelve states; the line is its way.",
    "excitation": "The paper's claim: with sample points the weights converge although the way excites "
    "only a few directions; without, they stay where they were or the run is lost. The right weights "
    "are known exactly for the linearised vehicle.",
}
_COLUMNS = (
    "From the state above; median and worst are those of the regret from all states. rms: distance "
    "from the station. Energy: electrical, of the thrusters. Peak thrust: largest share of a "
    "thruster's limit. Step: mean computing time of one control step, learning or predicting included."
)
WORDS = {
    "optimum": "the least cost that the game allows, computed offline for the exact model, with a "
    "certificate of its error",
    "learned": "the policy that learns while the vehicle moves, from the linear one on",
    "linear H-infinity": "the policy of the linearised game (its Riccati equation); learns nothing",
    "regret": "cost of a policy minus V*, divided by V*",
    "V*": "the cost of the optimum",
    "γ": "how dear the disturbance's effort is; a small γ prepares for a strong disturbance",
}

DISTURBED_WORDS = {
    "clairvoyant optimum": "the least cost over the time of the run for a control that knows the whole "
    "disturbance beforehand, from the same state, for the vehicle that is driven; V_c is this cost",
    "regret": "cost of a policy over the time of the run minus V_c, divided by V_c; nothing is added "
    "for what is left at the end",
    "dissipation margin": "how far the run stayed within the attenuation that the game promises",
}


def write_report(
    path: Path, comparison: Comparison, wide: Page, phone: Page, commands: Sequence[str]
) -> Path:
    """Write the report, figures embedded; raises InputError if the folder can't be written.

    Parameters
    ----------
    wide, phone : the same figures for a page and for a phone
    """
    name = comparison.station.model.vehicle.name
    body = [
        f"<h1>Station keeping of {escape(name)}: learned beside optimal</h1>",
        f'<p class="lead">{escape(verdict(comparison))}</p>',
        *[f'<p class="fault">{escape(too_short(comparison))}</p>' for _ in comparison.too_short[:1]],
        *[f'<p class="fault">{escape(fault)}</p>' for fault in comparison.faults],
        "<h2>What was asked</h2>",
        _asked(comparison),
        _folded("The words used here", _words(comparison)),
        "<h2>What came out</h2>",
        _table(*summary(comparison)),
        f"<p>{_COLUMNS}</p>",
        *[_figure(key, wide.pictures[key], phone.pictures[key]) for key in wide.pictures],
        "<h2>How sure it is</h2>",
        "<p>The optimum is judged by other means than the solver that found it: a finer mesh, the "
        "equations integrated again, the HJI at the initial state, finite differences, a longer "
        "horizon and a second method that shares no equations with the first.</p>",
        _table(*certificate(comparison)),
        *_clairvoyant(comparison),
        "<h2>The paper's conditions</h2>",
        "<p>They are sufficient, not necessary: a run may be good though one fails.</p>",
        _table(*conditions(comparison)),
        "<h2>Do it again</h2>",
        f"<pre>{escape(chr(10).join(commands))}</pre>",
        "<p>The records beside this report hold every number drawn here, with scenario, seed, versions "
        "and the hash of the compiled functions.</p>",
        _folded("The scenario", f"<pre>{escape(comparison.scenario.model_dump_json(indent=1))}</pre>"),
    ]
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,">'
        f"<title>{escape(name)}: learned beside optimal</title><style>{_STYLE}</style></head>"
        f"<body>{''.join(body)}</body></html>"
    )
    return write_text(path, page)


def _asked(comparison: Comparison) -> str:
    scenario = comparison.scenario
    state = ", ".join(f"{value:g}" for value in scenario.initial_state)
    others = comparison.n_states - 1
    more = f" and from {others} random states of the envelope" if others else ""
    if scenario.simulation.mode == "game":
        against = (
            "The disturbance is a second player, who wants the opposite and pays γ² for his effort "
            f"(γ = {scenario.game.gamma:g}); every policy meets the answer of this player to its own "
            "control, so that V* is the least possible cost for all of them."
        )
    else:
        kind = scenario.simulation.disturbance.kind
        against = (
            f"The disturbance is real ({kind}), and no policy knows it beforehand. The clairvoyant "
            "optimum does: it is the least that any control could pay over the time of the run that "
            "knows the whole disturbance from the start, and so what no policy can beat. How much more "
            "a policy pays is its regret: the price of not knowing the future, and of its own faults."
        )
    return (
        f"<p>From the state ({escape(state)}) [m, rad, m/s, rad/s]{more} the vehicle goes back to its "
        "station. The cost is the integral of weighted squares of position, attitude, rates and "
        f"control. {against} The learner has {comparison.station.basis.n_basis} basis functions, "
        "starts from the linear H-infinity policy, and learns only during the run that is scored.</p>"
    )


def _clairvoyant(comparison: Comparison) -> list[str]:
    """Return what the clairvoyant optimum is checked by, nothing without one."""
    if comparison.clairvoyant is None:
        return []
    return [
        "<p>The certificate above is that of the game's optimum, which V* and the errors along the way "
        "refer to. The clairvoyant optimum is checked on its own: the plant of the runs is integrated "
        "with its control, and it is solved from several starts. Where these lead to different minima, "
        "it is the least of them, and one that was not found may be lower still.</p>",
        _table(*clairvoyant_check(comparison.clairvoyant)),
    ]


def _words(comparison: Comparison) -> str:
    words = WORDS | (DISTURBED_WORDS if comparison.disturbed else {})
    entries = "".join(f"<li><b>{escape(k)}</b>: {escape(v)}</li>" for k, v in words.items())
    return f"<ul>{entries}</ul>"


def _folded(title: str, content: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def _figure(key: str, wide: bytes, phone: bytes) -> str:
    caption = escape(CAPTIONS[key])
    return (
        f"<figure><figcaption>{caption}</figcaption><picture>"
        f'<source media="(max-width: 640px)" srcset="{_data(phone)}">'
        f'<img alt="{caption}" src="{_data(wide)}"></picture></figure>'
    )


def _data(picture: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"


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
    return text[:1] in "0123456789-–" and text != ""
