"""The report as a browser shows it, on a desk and on a phone."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from .commands import COARSE, QUICK, run, sets

pytestmark = pytest.mark.slow
FIGURES = 15
BROKEN = "[...document.images].filter(image => !image.complete || !image.naturalWidth).length"
WIDTHS = "[...document.images].map(image => image.naturalWidth)"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("user")
    settings = sets(*QUICK, *COARSE)
    answer = run("compare", "--json", "--quiet", "--n-states", "2", *settings, cwd=folder)
    assert answer.code == 0
    return folder / str(answer.json()["report"])


@pytest.fixture(scope="module")
def browser() -> Any:
    """Return headless Chromium; CI has it, another machine need not."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None and "CI" not in os.environ:
        pytest.skip("there is no Chromium")
    api = pytest.importorskip("playwright.sync_api") if "CI" not in os.environ else None
    if api is None:
        import playwright.sync_api as api
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.mark.parametrize(("width", "narrow"), [(1280, False), (390, True)])
def test_every_figure_loads_and_nothing_is_cut(
    browser: Any, report: Path, width: int, narrow: bool
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 844})
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("requestfailed", lambda request: said.append(request.url[:80]))
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    page.wait_for_load_state("networkidle")
    assert said == []
    assert [url for url in asked if not url.startswith(("data:", "file:"))] == [], "it needs no network"
    assert page.evaluate(BROKEN) == 0
    widths = page.evaluate(WIDTHS)
    assert len(widths) == FIGURES
    assert all((natural < 700) == narrow for natural in widths), "a phone gets its own figures"
    assert page.evaluate("document.documentElement.scrollWidth") <= width, "nothing sticks out"
    text = page.inner_text("body")
    for words in ("What was asked", "What came out", "How sure it is", "Do it again"):
        assert words in text
