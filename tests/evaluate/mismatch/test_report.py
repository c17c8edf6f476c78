"""The page of a diagnosis in a real browser."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from evaluate.effects import catalogue
from evaluate.mismatch.diagnose import diagnose
from evaluate.mismatch.report import write_report

from .worlds import recorded, simulation


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    case = recorded(folder, simulation(), {"vignetting": {"power": 1.5}})
    write_report(folder / "report.html", diagnose(case, [e for e in catalogue() if e.id in ("vignetting", "glare")]))
    return folder / "report.html"


def test_the_slider_moves_and_every_picture_loads_without_a_request(page):
    playwright = pytest.importorskip("playwright.sync_api")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    with playwright.sync_playwright() as p:
        if program is None and not Path(p.chromium.executable_path).exists():
            pytest.skip("there is no Chromium here: `playwright install chromium`, or the package of the distribution")
        browser = p.chromium.launch(executable_path=program, args=["--no-sandbox"])
        tab = browser.new_page()
        requests: list[str] = []
        tab.on("request", lambda request: requests.append(request.url))
        tab.goto(page.as_uri())
        before = tab.locator("#over").evaluate("e => getComputedStyle(e).clipPath")
        tab.locator("#handle").fill("20")
        after = tab.locator("#over").evaluate("e => getComputedStyle(e).clipPath")
        loaded = tab.evaluate("() => [...document.images].map(i => i.complete && i.naturalWidth > 0)")
        source = tab.locator("#over").get_attribute("src")
        tab.locator("#which").select_option("after")
        other = tab.locator("#over").get_attribute("src")
        browser.close()
    assert before != after
    assert len(loaded) > 10
    assert all(loaded)
    assert source != other
    assert [url for url in requests if not url.startswith(("data:", "file:"))] == []
    assert sum(url.startswith("file:") for url in requests) == 1
