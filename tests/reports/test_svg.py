from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from importlib import resources

from matplotlib.figure import Figure

from vedette.evaluation.figures.style import SENSOR_COLOURS
from vedette.reports.svg import inline_svg

TEXT = '<b> & id="x" #222222 0.00123'


def drawing() -> Figure:
    figure = Figure(figsize=(3.5, 2.0))
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.12345678, 1.0], color="#0072B2")
    axes.set_title(TEXT)
    return figure


def tags_of(svg: str) -> str:
    """All of it but the texts in the figure."""
    return " ".join(re.findall(r"<[^>]*>", svg))


def test_texts_stay_what_they_are() -> None:
    root = ET.fromstring(_with_names(str(inline_svg(drawing(), "one", TEXT))))
    assert root.get("aria-label") == TEXT
    texts = [element.text for element in root.iter() if element.tag.endswith("text")]
    assert TEXT in texts


def test_colours_are_those_of_the_page_and_numbers_are_short() -> None:
    tags = tags_of(str(inline_svg(drawing(), "one", "")))
    assert "var(--blue)" in tags
    assert "var(--ink)" in tags
    assert not re.search(r"#0072b2|#000000|#ffffff", tags, re.IGNORECASE)
    assert not re.search(r"\d\.\d{3}", tags)


def test_two_figures_on_a_page_share_no_name_and_find_their_own() -> None:
    first, second = (tags_of(str(inline_svg(drawing(), prefix, ""))) for prefix in ("one", "two"))
    names = [set(re.findall(r'\bid="([^"]+)"', svg)) for svg in (first, second)]
    assert not names[0] & names[1]
    used = re.findall(r'(?:href="#|url\(#)([^")]+)', first)
    assert used
    assert set(used) <= names[0]


def _with_names(svg: str) -> str:
    """Inside HTML the names of SVG and XLink are known; an XML reader has to be told."""
    spaces = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    return svg.replace("<svg", f"<svg {spaces}", 1)


def test_elided_names_have_the_full_one_as_title() -> None:
    svg = str(inline_svg(drawing(), "one", "", {TEXT: "<full> name"}))
    assert "<title>&lt;full&gt; name</title>" in svg
    ET.fromstring(_with_names(svg))


def test_every_colour_of_a_sensor_has_a_shade_in_the_dark() -> None:
    css = (resources.files("vedette.reports") / "page" / "report.css").read_text(encoding="utf-8")
    light, dark = css.split("prefers-color-scheme: dark", 1)
    for place, colour in enumerate(SENSOR_COLOURS, start=1):
        assert f"--sensor-{place}: {colour.lower()};" in light
        assert f"--sensor-{place}: #" in dark
    figure = Figure()
    figure.subplots().plot([0.0, 1.0], color=SENSOR_COLOURS[0])
    assert "stroke: var(--sensor-1)" in inline_svg(figure, "g", "a line")
