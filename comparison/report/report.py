"""A self-contained HTML report: what was asked, what came out, how sure it is, how to do it again."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from ...online.records import write_text
from ..study import Comparison
from .report_tables import certificate, clairvoyant_check, conditions, summary, too_short
from .style import Page
from .words import CHECKED, words_of

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


def write_report(
    path: Path, comparison: Comparison, wide: Page, phone: Page, commands: Sequence[str]
) -> Path:
    """Write the report, figures embedded; raises InputError if the folder can't be written.

    Parameters
    ----------
    wide, phone : the same figures for a page and for a phone
    """
    name, told = comparison.setup.problem.name, words_of(comparison)
    body = [
        f"<h1>{escape(told.title)}: learned beside optimal</h1>",
        f'<p class="lead">{escape(comparison.verdict)}</p>',
        *[f'<p class="fault">{escape(too_short(comparison))}</p>' for _ in comparison.too_short[:1]],
        *[f'<p class="fault">{escape(fault)}</p>' for fault in comparison.faults],
        "<h2>What was asked</h2>",
        f"<p>{escape(told.asked)}</p>",
        _folded("The words used here", _list(told.words)),
        "<h2>What came out</h2>",
        _table(*summary(comparison)),
        f"<p>{escape(told.columns)}</p>",
        *[
            _figure(told.captions[key], wide.pictures[key], phone.pictures[key])
            for key in wide.pictures
        ],
        "<h2>How sure it is</h2>",
        "<p>The optimum is judged by other means than the solver that found it: a finer mesh, the "
        "equations integrated again, the HJI at the initial state, finite differences, a longer "
        "horizon and a second method that shares no equations with the first.</p>",
        _table(*certificate(comparison)),
        *_checked(comparison),
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


def _checked(comparison: Comparison) -> list[str]:
    """Return what the clairvoyant optimum is checked by, nothing without one."""
    if comparison.shown is comparison.optimal:
        return []
    return [f"<p>{escape(CHECKED)}</p>", _table(*clairvoyant_check(comparison.shown))]


def _list(words: Mapping[str, str]) -> str:
    entries = "".join(f"<li><b>{escape(k)}</b>: {escape(v)}</li>" for k, v in words.items())
    return f"<ul>{entries}</ul>"


def _folded(title: str, content: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def _figure(text: str, wide: bytes, phone: bytes) -> str:
    caption = escape(text)
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
