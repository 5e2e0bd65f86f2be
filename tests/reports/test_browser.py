"""The page in a real browser: it opens without complaint, loads nothing, and its replay does what its controls say."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import pytest

from evaluation.still_network import NAMES, STILL_NETWORK
from reports.browser import Browser, Page, chromium
from reports.examples import MIXED_SENSORS, MODES, SUMS, campaign_of, results_of
from vedette.reports import write_report
from waiting import PATIENCE

PROGRAM = chromium()
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no chromium or chrome on PATH to open the page in")


@pytest.fixture
def page(browser: Browser, report: Path) -> Page:
    return browser.open(report)


def state(page: Page) -> dict[str, str]:
    values: dict[str, str] = page.evaluate("({...document.getElementById('replay').dataset})")
    return values


def text(page: Page, part: str) -> str:
    return str(page.evaluate(f"document.querySelector('[data-part={part}]').textContent"))


def ink(page: Page, part: str) -> int:
    """How many different colours a canvas holds."""
    script = (
        f"(() => {{ const canvas = document.querySelector('[data-part={part}]');"
        "const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);"
        "return new Set(new Uint32Array(pixels.data.buffer)).size; })()"
    )
    return int(page.evaluate(script))


def wait_until(page: Page, condition: str) -> None:
    script = (
        f"new Promise((done, fail) => {{ const end = performance.now() + {1000 * PATIENCE:.0f}; const look = () => "
        f"({condition}) ? done() : performance.now() > end ? fail(new Error('waited in vain')) : setTimeout(look, 10); "
        "look(); })"
    )
    page.evaluate(script)


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (390, False)])
def test_it_opens_without_complaints_and_loads_nothing(browser: Browser, report: Path, width: int, dark: bool) -> None:
    page = browser.open(report, width=width, dark=dark)
    assert page.complaints() == []
    assert page.requests() == [page.url]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert ink(page, "scene") > 20
    assert ink(page, "errors") > 5


def test_light_and_dark_differ(browser: Browser, report: Path) -> None:
    script = "getComputedStyle(document.body).backgroundColor"
    assert browser.open(report).evaluate(script) != browser.open(report, dark=True).evaluate(script)


def test_buttons_step_and_play(page: Page) -> None:
    assert state(page)["step"] == "0"
    page.click("[data-part=forward]")
    page.click("[data-part=forward]")
    page.click("[data-part=back]")
    assert state(page)["step"] == "1"
    assert text(page, "summary").startswith("t = 2 s: 4 targets, ")
    page.click("[data-part=play]")
    assert state(page)["playing"] == "true"
    assert text(page, "play") == "Pause"
    wait_until(page, "Number(document.getElementById('replay').dataset.step) >= 3")
    page.click("[data-part=play]")
    step = state(page)["step"]
    assert state(page)["playing"] == "false"
    time.sleep(0.3)
    assert state(page)["step"] == step
    assert page.complaints() == []


def test_play_goes_at_the_speed_that_is_chosen(page: Page) -> None:
    page.evaluate("void (window.frames_due = [], window.requestAnimationFrame = (frame) => frames_due.push(frame))")
    choose(page, "speed", "10")
    assert state(page)["speed"] == "10"
    page.click("[data-part=play]")
    for now, step in ((1000, 0), (1500, 5), (1510, 5), (2000, 10), (9000, 39)):  # ms
        page.evaluate(f"frames_due.shift()({now})")
        assert state(page)["step"] == str(step)
    assert state(page)["playing"] == "false"
    assert page.evaluate("frames_due.length") == 0


def test_play_stops_at_the_end_and_starts_anew(page: Page) -> None:
    choose(page, "speed", "60")
    page.evaluate("document.getElementById('replay').focus()")
    page.press("End")
    assert state(page)["step"] == "39"
    page.press("Home")
    page.press(" ")
    wait_until(page, "document.getElementById('replay').dataset.step === '39'")
    assert state(page)["playing"] == "false"
    page.press(" ")
    wait_until(page, "Number(document.getElementById('replay').dataset.step) < 39")


def choose(page: Page, part: str, value: str) -> None:
    page.evaluate(
        f"(() => {{ const field = document.querySelector('[data-part={part}]'); field.value = '{value}'; "
        "field.dispatchEvent(new Event(field.type === 'range' ? 'input' : 'change', {bubbles: true})); })()"
    )


def test_keys_step_where_the_focus_is_on_the_replay(page: Page) -> None:
    page.press("ArrowRight")
    assert state(page)["step"] == "0"
    page.evaluate("document.querySelector('[data-part=scene]').focus()")
    for _ in range(3):
        page.press("ArrowRight")
    page.press("ArrowLeft")
    assert state(page)["step"] == "2"
    page.press(" ")
    assert state(page)["playing"] == "true"
    page.press(" ")
    assert state(page)["playing"] == "false"


def test_a_field_keeps_its_own_keys(page: Page) -> None:
    page.evaluate("document.querySelector('[data-part=scrubber]').focus()")
    page.press("ArrowRight")
    assert state(page)["step"] == "1"  # by the scrubber alone, not twice
    page.evaluate("document.querySelector('[data-part=play]').focus()")
    page.press(" ")
    assert state(page)["playing"] == "true"


def test_space_plays_and_pauses_from_the_slider(page: Page) -> None:
    page.evaluate("document.querySelector('[data-part=scrubber]').focus()")
    page.press(" ")
    assert state(page)["playing"] == "true"
    page.press(" ")
    assert state(page)["playing"] == "false"
    page.click(".menu summary")
    page.evaluate("document.querySelector('[data-show=trails]').focus()")
    page.press(" ")  # a box keeps it
    assert state(page)["playing"] == "false"
    assert not page.evaluate("document.querySelector('[data-show=trails]').checked")


def test_the_scrubber_shows_a_scan_with_its_decision(page: Page) -> None:
    assert text(page, "decision") == "No decision yet."
    assert page.evaluate("document.querySelector('[data-part=reward-block]').hidden")
    choose(page, "scrubber", "25")
    assert state(page)["step"] == "25"
    assert text(page, "decision").startswith("Decision at 20 s: ")
    assert ink(page, "rewards") > 20
    assert page.evaluate("document.querySelector('[data-part=scrubber]').getAttribute('aria-valuetext')") == (
        "step 26 of 40, 26 s"
    )
    assert "t = 26 s" in page.evaluate("document.querySelector('[data-part=scene]').getAttribute('aria-label')")


def test_another_run_can_be_chosen(page: Page) -> None:
    choose(page, "scrubber", "12")
    choose(page, "run", "1")
    assert state(page)["run"] == "1"
    assert ink(page, "rewards") > 5  # curves
    choose(page, "run", "2")
    assert "without rewards" in text(page, "decision")
    assert page.evaluate("document.querySelector('[data-part=reward-block]').hidden")


def scene_place(page: Page, what: str) -> tuple[float, float]:
    """Where in the window a thing of the shown scan is drawn; `what` gives its place in metres from the run's data."""
    page.middle("[data-part=scene]")
    script = (
        "(() => { const run = JSON.parse(document.getElementById('runs').textContent)[0];"
        f"const step = Number(document.getElementById('replay').dataset.step); const [east, north] = {what};"
        "const box = document.querySelector('[data-part=scene]').getBoundingClientRect();"
        "const [x0, x1, y0, y1] = run.extent; const width = box.width - 64; const height = box.height - 46;"
        "const scale = 0.96 * Math.min(width / (x1 - x0), height / (y1 - y0));"
        "return [box.x + 52 + width / 2 + (east - (x0 + x1) / 2) * scale,"
        " box.y + 10 + height / 2 - (north - (y0 + y1) / 2) * scale]; })()"
    )
    x, y = page.evaluate(script)
    return float(x), float(y)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("run.truth[step][1].slice(1, 3)", "target 2: at "),
        ("run.estimates[step][1].slice(1, 3)", "existence "),
        ("run.poses[step][0].slice(0, 2)", "sensor 1: at "),
        (
            "run.scans[step][0].find((m) => m[0] === 0 && Math.hypot(m[1], m[2]) < 900).slice(1, 3)",
            "clutter of sensor 1",
        ),
        ("run.scans[step][1].find((m) => m[0] === 2).slice(1, 3)", "detection of target 2 of sensor 2: bearing "),
    ],
)
def test_pointing_shows_a_description(page: Page, what: str, said: str) -> None:
    choose(page, "scrubber", "22")
    page.point(*scene_place(page, what))
    assert said in text(page, "hover")
    assert not page.evaluate("document.querySelector('[data-part=hover]').hidden")
    page.point(2, 2)
    assert page.evaluate("document.querySelector('[data-part=hover]').hidden")


def test_layers_can_be_hidden(page: Page) -> None:
    choose(page, "scrubber", "22")
    before: Any = page.evaluate("document.querySelector('[data-part=scene]').toDataURL()")
    page.click(".menu summary")
    for layer in ("measurements", "trails", "ellipses", "labels"):
        page.click(f"[data-show={layer}]")
        after = page.evaluate("document.querySelector('[data-part=scene]').toDataURL()")
        assert after != before
        before = after


def test_the_values_of_a_scan_can_be_read(page: Page) -> None:
    page.click("[data-part=values] summary")
    choose(page, "scrubber", "30")
    wait_until(page, "document.querySelectorAll('[data-part=rows] li').length >= 8")
    assert "target 1: at " in text(page, "rows")


def test_bearings_ranges_and_positions_are_drawn(browser: Browser, tmp_path: Path) -> None:
    campaign = campaign_of(planners=["stationary"], set=MIXED_SENSORS, runs=1)
    write_report(results_of(tmp_path / "results", campaign), tmp_path / "report.html")
    page = browser.open(tmp_path / "report.html")
    choose(page, "scrubber", "5")
    assert page.complaints() == []
    assert ink(page, "scene") > 20
    page.click(".menu summary")
    page.click("[data-show=trails]")
    kinds = page.evaluate("JSON.parse(document.getElementById('runs').textContent)[0].sensors.map((s) => s.kind)")
    assert kinds == ["ray", "circle"]


def test_modes_have_colours_and_a_legend(browser: Browser, tmp_path: Path) -> None:
    write_report(
        results_of(tmp_path / "results", campaign_of(planners=["stationary"], set=MODES, runs=1)),
        tmp_path / "report.html",
    )
    page = browser.open(tmp_path / "report.html")
    choose(page, "scrubber", "12")
    assert text(page, "modes-key").split() == ["in", "mode", "cruise", "in", "mode", "turn"]
    legend = "document.querySelector('[data-part=modes-key]').hidden"
    before = page.evaluate("document.querySelector('[data-part=scene]').toDataURL()")
    assert not page.evaluate(legend)
    page.click(".menu summary")
    page.click("[data-show=modes]")
    assert page.evaluate(legend)
    assert page.evaluate("document.querySelector('[data-part=scene]').toDataURL()") != before
    assert page.complaints() == []


def test_no_legend_of_modes_without_modes(page: Page) -> None:
    assert text(page, "modes-key") == ""
    assert page.evaluate("document.querySelector('[data-part=modes]').hidden")


def test_pointing_at_a_reward_shows_its_actions_and_value(page: Page) -> None:
    choose(page, "scrubber", "12")
    x, y = page.middle("[data-part=rewards]")
    page.point(x - 40, y)
    assert re.fullmatch(
        r"sensor 1 to \S+°, sensor 2 to \S+°: reward \d\.\d+( \(chosen\))?", text(page, "hover").strip()
    )
    choose(page, "run", "1")
    x, y = page.middle("[data-part=rewards]")
    page.point(x + 15.0, y)  # the middle of the curves: 40 pixels are left of them, 10 right
    first, second = text(page, "hover").splitlines()
    assert re.fullmatch(r"sensor 1 to 0°: reward \d\.\d+ ± 0\.\d+( \(chosen\))?", first)
    assert second.startswith("sensor 2 to 0°: reward ")
    assert page.complaints() == []


def test_a_network_with_names_and_zones_opens_without_complaints(browser: Browser, tmp_path: Path) -> None:
    results = results_of(tmp_path / "results", campaign_of(planners=["jdm", "idm"], runs=1, set=STILL_NETWORK))
    write_report(results, tmp_path / "page.html")
    page = browser.open(tmp_path / "page.html")
    page.evaluate("document.getElementById('replay').focus()")
    page.press("End")
    assert page.complaints() == []
    assert text(page, "reward-title") == "Reward (minus expected loss)"
    shown = str(page.evaluate("document.body.innerText"))
    assert all(word in shown for word in (*NAMES, "no-go zone", "sensors stay inside"))
    assert not re.search(r"\bsensor 1\b|\bS1\b", shown)


def test_the_replay_shows_why_a_decision_was_taken(browser: Browser, tmp_path: Path) -> None:
    """Bars of targets and sensors at the decision on display; nothing before the first."""
    write_report(
        results_of(tmp_path / "results", campaign_of(planners=["jdm"], runs=1, set=SUMS)), tmp_path / "why.html"
    )
    for width in (1280, 390):
        page = browser.open(tmp_path / "why.html", width=width)
        assert text(page, "decision") == "No decision yet."
        assert page.evaluate("document.querySelector('[data-part=why]').hidden")
        page.evaluate("document.getElementById('replay').focus()")
        page.press("End")
        assert text(page, "decision") == "Decision at 12 s."
        assert text(page, "why-not") == ""
        sentences = page.evaluate(
            "[...document.querySelectorAll('[data-part=why-words] li')].map((each) => each.textContent)"
        )
        assert re.fullmatch(r"sensor 1: .*\. Its scan adds \S+ to the reward, which is \S+ without it\.", sentences[0])
        assert len(sentences) == 2
        page.click(".gains summary")
        assert not page.evaluate("document.querySelector('[data-part=why]').hidden")
        assert "Second best" in text(page, "why-facts")
        assert "the best of all joint actions" in text(page, "why-facts")
        for part, names in (("targets", ["1.0", "1.1", "1.2", "1.3"]), ("sensors", ["sensor 1: ", "sensor 2: "])):
            shown = page.evaluate(
                f"[...document.querySelectorAll('[data-part=why-{part}] .name')].map((each) => each.textContent)"
            )
            assert all(any(name.startswith(each) for name in shown) for each in names), shown
        widths = page.evaluate(
            "[...document.querySelectorAll('.track i:not(.zero)')].map((each) => each.getBoundingClientRect().width)"
        )
        assert max(widths) > 30
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.complaints() == []


def test_a_decision_stored_without_rewards_is_marked(browser: Browser, tmp_path: Path) -> None:
    campaign = campaign_of(planners=["jdm", "random"], runs=1, set={**SUMS, "control.explain": False})
    write_report(results_of(tmp_path / "results", campaign), tmp_path / "without.html")
    page = browser.open(tmp_path / "without.html")
    page.evaluate("document.getElementById('replay').focus()")
    page.press("End")
    assert text(page, "why-not") == "This decision was kept without why it was taken."
    choose(page, "run", "1")
    assert text(page, "why-not") == "This decision was not made on rewards."
    assert page.evaluate("document.querySelector('[data-part=why]').hidden")
    assert page.complaints() == []
