"""The replay's scene in a real browser: zoom, pan, follow, a ghost of another run, and where the pointer is."""

from __future__ import annotations

import json
import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from recordings import ORIGIN
from reports.browser import Browser, Page
from reports.test_browser import PROGRAM, choose, ink, state, text, wait_until
from reports.test_single import tracked
from vedette.campaigns.results import CampaignResults
from vedette.recorded import Origin
from vedette.reports import write_report, write_run_report

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no chromium or chrome on PATH to open the page in")


@pytest.fixture(scope="module")
def paired(results: CampaignResults, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("paired") / "report.html"
    write_report(results, path, replays=[("jdm", 0), ("idm", 0), ("random", 1)])
    return path


@pytest.fixture
def page(browser: Browser, paired: Path) -> Page:
    return browser.open(paired)


def place(page: Page) -> tuple[float, float]:
    """What the page says of the pointer's place, or of the middle, m."""
    found = re.findall(r"(\N{MINUS SIGN}?[\d.]+) (k?m)", text(page, "place"))
    x, y = (float(n.replace("\N{MINUS SIGN}", "-")) * (1000.0 if unit == "km" else 1.0) for n, unit in found[:2])
    return x, y


def zoom(page: Page) -> float:
    return float(state(page)["zoom"])


def test_the_wheel_zooms_where_the_pointer_is_and_lets_the_page_scroll_at_the_end(page: Page) -> None:
    x, y = map(round, page.middle("[data-part=scene]"))
    page.point(x + 90, y - 70)
    before = place(page)
    page.wheel(x + 90, y - 70, -400)
    wait_until(page, "Number(document.getElementById('replay').dataset.zoom) > 2")
    assert place(page) == pytest.approx(before, abs=0.2)
    page.wheel(x + 90, y - 70, 4000)
    wait_until(page, "document.getElementById('replay').dataset.zoom === '1'")
    wheel = "new WheelEvent('wheel', {deltaY: 99, cancelable: true})"
    assert page.evaluate(
        f"document.querySelector('[data-part=scene]').dispatchEvent({wheel})"
    )  # nobody keeps it from the page
    assert page.complaints() == []


def test_keys_and_buttons_zoom_move_and_show_all(page: Page) -> None:
    page.evaluate("document.querySelector('[data-part=scene]').focus()")
    whole = place(page)
    page.press("+")
    page.press("+")
    assert zoom(page) == pytest.approx(1.5**2)
    page.press("-")
    page.click("[data-part=zoom-in]")
    page.point(1, 1)
    wait_until(page, "Math.abs(Number(document.getElementById('replay').dataset.zoom) - 2.25) < 1e-6")
    assert place(page) == pytest.approx(whole, abs=0.2)
    page.evaluate("document.querySelector('[data-part=scene]').focus()")
    page.press("ArrowRight", shift=True)
    page.press("ArrowUp", shift=True)
    moved = place(page)
    assert moved[0] > whole[0] + 10.0
    assert moved[1] > whole[1] + 10.0
    assert state(page)["step"] == "0"  # plain arrows step
    page.press("0")
    assert (zoom(page), place(page)) == (1.0, whole)
    page.press("ArrowLeft", shift=True)
    assert place(page) == whole  # all of it is there
    page.click("[data-part=zoom-in]")
    page.click("[data-part=reset]")
    assert zoom(page) == 1.0


def test_dragging_takes_the_place_along(page: Page) -> None:
    page.click("[data-part=zoom-in]")
    x, y = page.middle("[data-part=scene]")
    page.point(x, y)
    before = place(page)
    page.drag(x, y, 60, 25)
    assert place(page) == pytest.approx(before, abs=0.2)
    page.point(x, y)
    after = place(page)
    assert after[0] < before[0] - 5.0
    assert after[1] > before[1] + 2.0
    page.point(x + 9, y)
    assert place(page) != after  # let go of


@pytest.mark.parametrize("what", ["sensor 0", "target 2"])
def test_what_is_followed_stays_in_the_middle(page: Page, what: str) -> None:
    choose(page, "follow", what)
    assert zoom(page) == 3.0
    kind, number = what.split()
    script = "JSON.parse(document.getElementById('runs').textContent)[0]"
    run = json.loads(page.evaluate(f"JSON.stringify({script})"))
    for step in (0, 25, 39):
        choose(page, "scrubber", str(step))
        if kind == "sensor":
            wanted = run["poses"][step][int(number)][:2]
        else:
            wanted = next(row[1:3] for row in run["truth"][step] if row[0] == int(number))
        assert place(page) == pytest.approx(wanted, abs=0.2)
    x, y = page.middle("[data-part=scene]")
    page.drag(x, y, 40, 0)
    assert page.evaluate("document.querySelector('[data-part=follow]').value") == ""


def test_another_run_of_the_same_number_can_be_its_ghost(page: Page) -> None:
    options = "[...document.querySelector('[data-part=ghost]').options].map((option) => option.text)"
    assert page.evaluate(options) == ["nothing", "IDM"]
    choose(page, "scrubber", "30")
    pixels = "document.querySelector('[data-part=scene]').toDataURL()"
    key = "document.querySelector('[data-part=ghost-key]').hidden"
    alone = page.evaluate(pixels)
    assert page.evaluate(key)
    choose(page, "ghost", "1")
    assert page.evaluate(pixels) != alone
    assert not page.evaluate(key)
    choose(page, "run", "2")  # whose number no other has
    assert page.evaluate("document.querySelector('[data-part=ghost]').parentElement.hidden")
    assert page.evaluate(key)
    assert page.complaints() == []


def test_two_fingers_zoom_on_a_phone(browser: Browser, paired: Path) -> None:
    page = browser.open(paired, width=390)
    x, y = page.middle("[data-part=scene]")
    assert page.evaluate("document.querySelector('[data-part=scene]').style.touchAction") == "pan-y"
    page.pinch(x, y, 30, 90)
    wait_until(page, "Number(document.getElementById('replay').dataset.zoom) > 2")
    assert zoom(page) == pytest.approx(3.0, rel=0.1)
    assert page.evaluate("document.querySelector('[data-part=scene]').style.touchAction") == "none"
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert ink(page, "scene") > 20
    assert page.complaints() == []


def test_a_recording_without_known_targets_has_no_empty_panels(browser: Browser, tmp_path: Path) -> None:
    (scenario, *_), record = tracked(tmp_path, truth=False)
    write_run_report(record, scenario, tmp_path / "page.html")
    page = browser.open(tmp_path / "page.html")
    choose(page, "scrubber", "10")
    assert text(page, "summary").startswith("2016-01-12 13:02:")
    assert "OSPA" not in text(page, "summary")
    for part in ("side", "rewards", "decision", "lost-key", "nothing"):
        assert page.evaluate(f"document.querySelector('[data-part={part}]').getClientRects().length") == 0
    assert page.evaluate("document.querySelector('[data-part=follow]').options[3].text").startswith("track ")
    found = re.search(r"([\d.]+)° N, ([\d.]+)° W", text(page, "place"))
    assert found is not None
    (longitude, latitude) = ORIGIN.to_degrees([place(page)])[0]
    assert (float(found[1]), -float(found[2])) == pytest.approx((latitude, longitude), abs=1e-4)
    assert page.complaints() == []
    assert page.requests() == [page.url]


@pytest.mark.parametrize("origin", [Origin(-1.1171, 50.7865), Origin(179.9, -66.0), Origin(10.0, 0.0)])
def test_degrees_are_those_of_the_library(browser: Browser, paired: Path, origin: Origin) -> None:
    places = np.random.default_rng(0).uniform(-300e3, 300e3, (30, 2))
    script = (resources.files("vedette.reports") / "page/scripts/3-earth.js").read_text("utf-8")
    at = [origin.longitude_deg, origin.latitude_deg]
    found = browser.open(paired).evaluate(
        f"(() => {{ {script}; return {places.tolist()}.map(([x, y]) => earthBelow({at}, x, y)); }})()"
    )
    apart = np.degrees(found) - origin.to_degrees(places)
    np.testing.assert_allclose((apart + 180.0) % 360.0 - 180.0, 0.0, atol=1e-6)
