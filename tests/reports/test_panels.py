"""Runs side by side in a real browser, with one clock and one plane; and the clock and names of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from reports.browser import Browser, Page, chromium
from reports.test_browser import choose, scene_place, state, text, wait_until
from reports.test_single import data_of, tracked
from simulation.test_recorded_classes import recording_of
from vedette.campaigns.results import CampaignResults
from vedette.errors import InputError
from vedette.evaluation import track_recording
from vedette.evaluation.figures import video
from vedette.evaluation.track_formats import utc_text
from vedette.reports import write_demo, write_report, write_run_report

PROGRAM = chromium()
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no chromium or chrome on PATH to open the page in")
CANVASES = "[...document.querySelectorAll('.panel canvas')]"


@pytest.fixture(scope="module")
def paired(results: CampaignResults, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of three strategies run 1, and of one of them run 0."""
    path = tmp_path_factory.mktemp("panels") / "report.html"
    write_report(results, path, replays=[("jdm", 1), ("idm", 1), ("random", 1), ("jdm", 0)])
    return path


@pytest.fixture
def page(browser: Browser, paired: Path) -> Page:
    return browser.open(paired, width=1400)


def captions(page: Page) -> list[str]:
    found: list[str] = page.evaluate(
        "[...document.querySelectorAll('.panel .caption')].map((each) => each.textContent)"
    )
    return found


def colours(page: Page) -> list[int]:
    """How many colours each panel holds."""
    found: list[int] = page.evaluate(
        f"{CANVASES}.map((canvas) => new Set(new Uint32Array(canvas.getContext('2d').getImageData("
        "0, 0, canvas.width, canvas.height).data.buffer)).size)"
    )
    return found


def options(page: Page, part: str) -> list[list[str]]:
    script = f"[...document.querySelector('[data-part={part}]').options].map(({{value, text}}) => [value, text])"
    found: list[list[str]] = page.evaluate(script)
    return found


def tabs(page: Page) -> list[list[str]]:
    """Name and mean error of each tab, and whether it is the one that is shown."""
    found: list[list[str]] = page.evaluate(
        "[...document.querySelectorAll('.tab')].map((tab) => [tab.querySelector('.name').textContent, "
        "tab.querySelector('.mean').textContent, tab.getAttribute('aria-pressed')])"
    )
    return found


def test_a_demo_opens_where_two_strategies_differ(browser: Browser, results: CampaignResults, tmp_path: Path) -> None:
    written = write_demo(results, tmp_path / "there" / "demo.html")
    page = browser.open(written, width=1400)
    assert [caption.split(":")[0] for caption in captions(page)] == ["JDM", "IDM"]
    jdm, idm = (results.record(name, 0).ospa[:, 0] for name in ("jdm", "idm"))
    apart = abs(jdm - idm)
    assert apart[int(state(page)["step"])] >= 0.9 * apart.max()
    assert text(page, "play") == "Play"
    counted = slice(10, 40)
    errors = [results.record(name, 0).ospa[counted, 0].mean() for name in ("jdm", "idm", "random")]
    shown = tabs(page)
    assert [name for name, _, _ in shown] == ["JDM", "IDM", "Random"]
    assert [float(mean.removesuffix(" m")) for _, mean, _ in shown] == pytest.approx(errors, abs=0.06)
    page.click("[data-tab='2']")
    assert [pressed for *_, pressed in tabs(page)] == ["false", "false", "true"]
    assert page.complaints() == []
    assert "Same targets, same noise" in page.evaluate("document.querySelector('.lead').textContent")
    with pytest.raises(InputError, match="path: expected a place to write a report"):
        write_demo(results, tmp_path / "there")


def test_the_timeline_can_be_dragged_and_names_events(page: Page) -> None:
    page.evaluate("document.querySelector('[data-part=errors]').scrollIntoView({block: 'center', behavior: 'instant'})")
    box = page.evaluate(
        "(({x, y, width, height}) => [x, y, width, height])"
        "(document.querySelector('[data-part=errors]').getBoundingClientRect())"
    )
    x, y, width, height = box
    start, end = x + 52, x + width - 12
    page.drag(start + 5, y + height / 2, (end - start) / 2, 0)
    assert abs(int(state(page)["step"]) - 20) <= 1
    page.drag(start + (end - start) / 2, y + height / 2, width, 0)
    assert state(page)["step"] == "39"
    assert page.complaints() == []


def test_another_run_can_be_shown_alongside(page: Page) -> None:
    assert options(page, "beside") == [["", "nothing"], ["1", "IDM"], ["2", "Random"]]
    assert page.evaluate(f"{CANVASES}.length") == 1
    choose(page, "beside", "1")
    assert page.evaluate(f"{CANVASES}.length") == 2
    assert page.complaints() == []
    assert min(colours(page)) > 20
    assert [caption.split(":")[0] for caption in captions(page)] == ["JDM", "IDM"]
    sizes = page.evaluate(f"{CANVASES}.map((canvas) => [canvas.clientWidth, canvas.clientHeight].join())")
    assert len(set(sizes)) == 1
    choose(page, "beside", "")
    assert page.evaluate(f"{CANVASES}.length") == 1
    assert page.evaluate("document.querySelector('[data-part=caption]').hidden")
    choose(page, "run", "3")  # the only one of its number
    assert page.evaluate("document.querySelector('[data-part=beside]').parentElement.hidden")


def test_they_have_one_clock(page: Page, results: CampaignResults) -> None:
    choose(page, "beside", "2")
    errors = {name: results.record(name, 1).ospa[:, 0] for name in ("jdm", "random")}
    for step in (0, 12, 25):
        choose(page, "scrubber", str(step))
        for caption, (name, ospa) in zip(captions(page), errors.items(), strict=True):
            assert caption.endswith(f"OSPA {ospa[step]:.1f} m"), (name, step)
    pixels = "document.querySelector('[data-part=errors]').toDataURL()"
    several = page.evaluate(pixels)
    choose(page, "beside", "")
    assert page.evaluate(pixels) != several  # without their curves
    choose(page, "run", "1")  # another one comes first; what stood beside is no choice of its
    assert state(page)["step"] == "25"


def test_the_wheel_and_the_mouse_move_all_planes_from_any_panel(page: Page) -> None:
    choose(page, "beside", "1")
    script = f"(() => {{ const box = {CANVASES}[1].getBoundingClientRect(); return [box.x + 200, box.y + 150]; }})()"
    page.evaluate(f"{CANVASES}[1].scrollIntoView({{block: 'center', behavior: 'instant'}})")
    x, y = page.evaluate(script)
    pictures = f"{CANVASES}.map((canvas) => canvas.toDataURL())"
    before = page.evaluate(pictures)
    page.wheel(x, y, -400)
    wait_until(page, "Number(document.getElementById('replay').dataset.zoom) > 2")
    zoomed = page.evaluate(pictures)
    page.drag(x, y, -60, 40)
    moved = page.evaluate(pictures)
    for panel in range(2):
        assert len({before[panel], zoomed[panel], moved[panel]}) == 3
    assert page.complaints() == []


def test_what_is_under_the_pointer_is_of_its_panel(page: Page, results: CampaignResults) -> None:
    choose(page, "beside", "2")
    choose(page, "scrubber", "30")
    place = results.record("random", 1).poses[30, 0]
    page.evaluate(f"{CANVASES}[1].scrollIntoView({{block: 'center', behavior: 'instant'}})")
    box = f"{CANVASES}[1].getBoundingClientRect()"
    x, y, width, height = page.evaluate(f"(({{x, y, width, height}}) => [x, y, width, height])({box})")
    west, east, south, north = data_extent(page)
    scale = 0.96 * min((width - 64) / (east - west), (height - 46) / (north - south))  # within the margins
    px = x + 52 + (width - 64) / 2 + (place[0] - (west + east) / 2) * scale
    py = y + 10 + (height - 46) / 2 - (place[1] - (south + north) / 2) * scale
    page.point(px, py)
    wait_until(page, "document.querySelector('[data-part=hover]').textContent.includes('sensor 1: at')")


def data_extent(page: Page) -> Any:
    """Of both runs: the sensor went where the first run has none."""
    extents = page.evaluate("JSON.parse(document.getElementById('runs').textContent).map((run) => run.extent)")
    first, _, other, _ = extents
    assert first != other
    return [end(pair) for end, pair in zip((min, max, min, max), zip(first, other, strict=True), strict=True)]


@pytest.mark.parametrize("width", [1400, 800, 390])
def test_they_fit_any_width(browser: Browser, paired: Path, width: int) -> None:
    page = browser.open(paired, width=width)
    choose(page, "beside", "1")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    tops = page.evaluate(f"{CANVASES}.map((canvas) => canvas.getBoundingClientRect().top)")
    assert (tops[0] == tops[1]) == (width > 600)
    assert min(page.evaluate(f"{CANVASES}.map((canvas) => canvas.clientHeight)")) > 250
    assert page.complaints() == []


def test_a_recording_has_its_clock_and_its_names(browser: Browser, tmp_path: Path) -> None:
    (scenario, recording, _), record = tracked(tmp_path, truth=True)
    data = data_of(record, scenario)
    assert (data["utc"], data["names"]) == (recording.start, ("ship 0", "ship 1", "ship 2"))
    write_run_report(record, scenario, tmp_path / "page.html")
    page = browser.open(tmp_path / "page.html")
    choose(page, "scrubber", "7")
    utc = utc_text(recording.start + recording.times[7])
    assert text(page, "summary").startswith(f"{utc[:10]} {utc[11:21]} UTC (t = ")
    assert [name for _, name in options(page, "follow")] == ["nothing", "Calshot", "boat", "ship 0", "ship 1", "ship 2"]
    page.click("[data-part=values] summary")
    wait_until(page, "document.querySelector('[data-part=rows]').childElementCount")
    assert "ship 1: at" in text(page, "rows")
    assert "from ship 1" in text(page, "rows")
    assert page.evaluate("document.querySelector('[data-part=beside]').parentElement.hidden")
    assert page.complaints() == []


def test_an_estimate_under_the_pointer_has_its_class(browser: Browser, tmp_path: Path) -> None:
    found = recording_of(tmp_path)
    write_run_report(track_recording(found.scenario, found.recording), found.scenario, tmp_path / "page.html")
    page = browser.open(tmp_path / "page.html")
    choose(page, "scrubber", "30")
    page.point(*scene_place(page, "run.estimates[step].find((row) => row[2] > 0).slice(1, 3)"))
    assert "; cargo 1.00" in text(page, "hover")
    page.click("[data-part=values] summary")
    wait_until(page, "document.querySelector('[data-part=rows]').childElementCount")
    assert "; fishing 1.00" in text(page, "rows")
    assert page.complaints() == []


def test_another_recording_than_the_runs_has_no_clock(tmp_path: Path) -> None:
    (scenario, *_), record = tracked(tmp_path, truth=False)
    lines = (tmp_path / "scans.csv").read_text("utf-8").splitlines()
    (tmp_path / "scans.csv").write_text("\n".join(lines[:1] + lines[9:]), "utf-8")
    assert data_of(record, scenario)["utc"] is None


def test_a_video_has_its_clock_and_its_names(tmp_path: Path) -> None:
    (scenario, recording, _), record = tracked(tmp_path, truth=True)
    drawing = video._Drawing(record, scenario, False)
    drawing.show(7)
    (axes,) = drawing.figure.axes[:1]
    utc = utc_text(recording.start + recording.times[7])
    assert axes.get_title() == f"Recorded scans, scans.csv: {utc[:10]} {utc[11:21]} UTC"
    assert {"ship 0", "ship 1", "ship 2"} <= {each.get_text() for each in axes.texts}
