"""`compare`: runs, regret, figures and the report, small by default and in full as evidence."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stationkeep.online import load

from .commands import COARSE, QUICK, Answer, call, files_in, run, sets

SMALL = sets(*QUICK, *COARSE)
FIGURES = {
    *("states", "rates", "cost", "forces_body", "forces_earth", "thrusters", "weights"),
    *("bellman", "monitor", "excitation", "regret", "energy", "path", "errors", "field"),
}
POLICIES = {"learned", "linear", "lqr", "pid", "mpc", "quadratic", "gradient"}
RECORDS = POLICIES | {"optimal", "analysis"}


class Page(HTMLParser):
    """What a browser would load or link to, and the text that it would show."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.references: list[str] = []
        self.images: list[bytes] = []
        self.phone_images: list[bytes] = []
        self.without_text: list[str] = []
        self.shown = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in ("meta", "img", "br", "link", "input", "hr", "source"):
            self.open.append(tag)
        given = dict(attrs)
        for name in ("src", "href", "data", "action", "poster", "srcset"):
            value = given.get(name)
            if value is None:
                continue
            if value.startswith("data:image/png;base64,"):
                picture = base64.b64decode(value.partition(",")[2], validate=True)
                (self.images if tag == "img" else self.phone_images).append(picture)
            elif tag == "link" and value == "data:,":
                continue  # an empty icon, so that no browser asks for one
            else:
                self.references.append(value)
        if tag == "img" and not given.get("alt"):
            self.without_text.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"<{tag}> is closed where another is open"

    def handle_data(self, data: str) -> None:
        self.shown += data if self.open and self.open[-1] != "style" else ""


def assert_self_contained(report: Path, figures: dict[str, str], cwd: Path) -> Page:
    """Check that a report needs no other file and no network, and holds every figure."""
    text = report.read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    assert page.references == []
    assert page.without_text == []
    assert not set(page.tags) & {"script", "iframe", "object", "embed", "base"}
    assert not re.search(r"url\(|@import", text)
    assert not re.search(r"https?://", text)
    written = [(cwd / path).read_bytes() for path in figures.values()]
    assert sorted(page.images) == sorted(written)
    assert len(page.phone_images) == len(page.images)
    for image in (*page.images, *page.phone_images):
        assert image.startswith(b"\x89PNG")
        assert len(image) > 10_000
    assert str(cwd) not in text
    return page


def check_shape(answer: dict[str, Any]) -> None:
    assert {"regret", "envelope_scale", "n_states", "value_error", "figures", "report"} <= set(answer)
    assert set(answer["regret"]) == POLICIES
    for distribution in answer["regret"].values():
        assert {"median", "p90", "max", "diverged"} <= set(distribution)
        assert isinstance(distribution["diverged"], int)
    assert answer["envelope_scale"] == 0.35
    assert set(answer["figures"]) == FIGURES


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("user")


@pytest.fixture(scope="module")
def small(folder: Path) -> Answer:
    words = ("compare", "--json", "--quiet", "--n-states", "1", "--workers", "1")
    return run(*words, *SMALL, cwd=folder)


@pytest.mark.slow
def test_small_compare(small: Answer, folder: Path) -> None:
    assert small.code == 0
    assert small.err == ""
    answer = small.json()
    check_shape(answer)
    assert answer["n_states"] == 1
    assert 0.0 <= answer["value_error"] <= 1e-6
    results = folder / "results" / "bluerov2-heavy"
    assert {path.stem for path in (results / "records").iterdir()} == RECORDS
    assert {path.stem for path in (results / "figures").iterdir()} == FIGURES
    assert (folder / answer["report"]) == results / "report.html"
    # a PNG and a PDF of each figure, and the report
    assert len(files_in(folder)) == len(RECORDS) + 2 * len(FIGURES) + 1
    for name in FIGURES:
        assert (results / "figures" / f"{name}.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.slow
def test_small_report(small: Answer, folder: Path) -> None:
    answer = small.json()
    page = assert_self_contained(folder / answer["report"], answer["figures"], folder)
    for words in ("BlueROV2 Heavy", "offline optimum", "(26) corrected", "linear H-infinity"):
        assert words in page.shown
    command = next(line for line in page.shown.splitlines() if "stationkeep compare" in line)
    for override in (*QUICK, *COARSE):
        assert override in command, "the report says how to do it again"


@pytest.mark.slow
def test_a_run_too_short_for_a_regret_says_so(small: Answer) -> None:
    """After 2 s most of the cost is an estimate, ζ'P ζ: nothing can cost less than the optimum."""
    answer = small.json()
    for name, distribution in answer["regret"].items():
        median = distribution["median"]
        assert median is None or median > -1e-6 or name in str(answer.get("notes")), (name, median)


@pytest.mark.slow
def test_all_policies_start_alike(small: Answer, folder: Path) -> None:
    assert small.code == 0
    records = folder / "results" / "bluerov2-heavy" / "records"
    starts = [load(records / f"{name}.nc")["zeta"].values[0] for name in POLICIES | {"optimal"}]
    for start in starts:
        np.testing.assert_allclose(start, starts[0], rtol=1e-12, atol=1e-12)
    optimal = load(records / "optimal.nc")
    assert optimal.attrs["value"] == small.json()["value"]


@pytest.mark.slow
def test_small_compare_from_two_states(tmp_path: Path) -> None:
    answer = run("compare", "--json", "--quiet", "--n-states", "2", *SMALL, cwd=tmp_path)
    assert answer.code == 0
    assert answer.json()["n_states"] == 2
    names = files_in(tmp_path / "results" / "bluerov2-heavy" / "records")
    kinds = ("optimal", "learned", "linear", "lqr", "pid", "mpc")
    assert {f"state-2-{kind}.nc" for kind in kinds} <= set(names)


@pytest.mark.slow
def test_compare_continues_from_learned_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The benchmark case with another basis can't start from the weights of this one."""
    monkeypatch.chdir(tmp_path)
    settings = sets("samples.number=200", "simulation.duration=0.5", *COARSE)
    assert call(capsys, "online", "--quiet", "--out", "first", *settings).code == 0
    settings += sets("learner.weights='first/learned.nc'")
    answer = call(capsys, "compare", "--json", "--quiet", "--n-states", "1", *settings)
    assert answer.err == ""
    assert answer.code == 0
    assert set(answer.json()["regret"]) == POLICIES


@pytest.mark.slow
def test_full_compare(tmp_path: Path) -> None:
    """The default scenario: certified, learned better than linear, a whole report, records kept."""
    words = ("compare", "--json", "--quiet", "--n-states", "1", "--out", "out")
    first = run(*words, cwd=tmp_path, timeout=600.0)
    assert first.code == 0
    answer = first.json()
    check_shape(answer)
    assert answer["faults"] == []
    assert all(distribution["diverged"] == 0 for distribution in answer["regret"].values())
    learned, linear = (answer["regret"][name]["median"] for name in ("learned", "linear"))
    assert 0.0 < learned < linear
    assert learned < 0.006
    assert 0.009 < linear < 0.011
    assert answer["value_error"] <= 1e-6
    page = assert_self_contained(tmp_path / answer["report"], answer["figures"], tmp_path)
    assert f"{100 * learned:.3f} % more than the optimum" in page.shown
    end = load(tmp_path / "out" / "records" / "learned.nc")["zeta"].values[-1]
    assert np.abs(end).max() < 0.01, "the vehicle is back at its station"
    records = tmp_path / "out" / "records"
    before = {path.name: path.stat().st_mtime_ns for path in records.iterdir()}
    assert {Path(name).stem for name in before} == RECORDS
    again = run(*words, cwd=tmp_path, timeout=600.0)
    assert again.json()["regret"] == answer["regret"]
    assert {path.name: path.stat().st_mtime_ns for path in records.iterdir()} == before
