"""Matplotlib figures as inline elements of a page, with its light and dark colours and unique ids."""

import base64
import html
import re
from collections.abc import Mapping

from markupsafe import Markup
from matplotlib.figure import Figure

from vedette.evaluation.figures import png_bytes, svg_text
from vedette.evaluation.figures.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SENSOR_COLOURS, SKY, VERMILION

# Colours that the page's style sheet changes in dark mode.
_VARIABLES = {
    "#000000": "ink",
    INK: "ink",
    "#FFFFFF": "paper",
    "#DDDDDD": "line",
    "#CCCCCC": "line",
    GREY: "grey",
    BLUE: "blue",
    VERMILION: "vermilion",
    GREEN: "green",
    PURPLE: "purple",
    ORANGE: "orange",
    SKY: "sky",
    **{colour: f"sensor-{place}" for place, colour in enumerate(SENSOR_COLOURS, start=1)},
}
_COLOUR = re.compile("|".join(_VARIABLES), re.IGNORECASE)
_NAMES = {colour.lower(): f"var(--{name})" for colour, name in _VARIABLES.items()}
_TAG = re.compile(r"<[^>]*>")
_TEXT = re.compile(r"(<text[^>]*>)([^<]*)(?=</text>)")
_LONG_NUMBER = re.compile(r"(\d+\.\d{2})\d+")
_POINTS_TO_PIXELS = 1.9
_DOTS_PER_INCH = 200


def inline_svg(figure: Figure, prefix: str, description: str, names: Mapping[str, str] | None = None) -> Markup:
    """Return an `svg` element as wide as its container, up to a readable maximum width.

    Args:
        figure: the figure.
        prefix: prefix of every id in the figure, unique on the page.
        description: description for screen readers.
        names: elided names and the full ones, shown as tooltips of texts that contain the elided ones.
    """
    text = svg_text(figure)
    body = text[text.index(">", text.index("<svg")) + 1 :]
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", body, flags=re.DOTALL)
    body = _TAG.sub(lambda tag: _adapted(tag.group(), prefix), body)
    if names:
        body = _TEXT.sub(lambda text: _titled(text, names), body)
    width, height = (72.0 * float(length) for length in figure.get_size_inches())
    opening = Markup('<svg viewBox="0 0 {:g} {:g}" role="img" aria-label="{}" style="max-width: {:.0f}px">').format(
        round(width, 2), round(height, 2), description, _POINTS_TO_PIXELS * width
    )
    return opening + Markup(body)  # safe: Matplotlib escapes the texts in a figure


def inline_png(figure: Figure, description: str) -> Markup:
    """Return an `img` element with the figure as pixels: bounded in size, and in the colours of paper."""
    content = base64.b64encode(png_bytes(figure, dots_per_inch=_DOTS_PER_INCH)).decode()
    width = _POINTS_TO_PIXELS * 72.0 * float(figure.get_size_inches()[0])
    return Markup('<img src="data:image/png;base64,{}" alt="{}" style="max-width: {:.0f}px">').format(
        content, description, width
    )


def _adapted(tag: str, prefix: str) -> str:
    """Return a tag with unique ids, the page's colours, and numbers rounded to a hundredth of a point."""
    tag = re.sub(r'\bid="', f'id="{prefix}-', tag)
    tag = re.sub(r'(href="#|url\(#)', rf"\g<1>{prefix}-", tag)
    tag = _COLOUR.sub(lambda match: _NAMES[match.group().lower()], tag)
    return _LONG_NUMBER.sub(r"\1", tag).replace(" \n", " ")


def _titled(text: re.Match[str], names: Mapping[str, str]) -> str:
    opening, shown = text.groups()
    full = shown
    for short, name in names.items():
        full = full.replace(html.escape(short, quote=False), html.escape(name, quote=False))
    return text.group() if full == shown else f"{opening}<title>{full}</title>{shown}"
