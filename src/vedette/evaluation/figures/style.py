"""One look for all figures: a paper's column wide, 8 pt, colours that survive colour blindness and grey print."""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache, wraps
from importlib import resources
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from vedette.errors import InputError
from vedette.internal.text import with_minus
from vedette.kernels.base.types import Floats

_P = ParamSpec("_P")
_R = TypeVar("_R")

COLUMN_WIDTH = 3.5  # inches, of an IEEE column
TEXT_WIDTH = 7.16  # inches, of both columns

# M. Okabe and K. Ito, "Color Universal Design" (2008), without the yellow that is lost on white; darkest last.
BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
# Of sensors, none of them a strategy's: P. Tol's "muted" ones that are farthest from those, and two darker.
SENSOR_COLOURS = ("#332288", "#999933", "#882255", "#7A5C3E", "#1B4D3E", "#44AA99")
GREY = "#6E6E6E"
INK = "#222222"
MARKERS = "osD^vP"
LINE_STYLES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1.2, 1.2)),
    (0, (5, 1.5, 1.2, 1.5)),
    (0, (8, 2)),
    (0, (3, 1, 1, 1, 1, 1)),
)
HEAT_MAP = "cividis"

# TrueType fonts for letters that DejaVu Sans lacks, on machines that have one of them.
_OTHER_FONTS = (
    "Noto Sans SC", "Noto Sans JP", "Noto Sans KR", "Droid Sans Fallback", "IPAGothic", "SimHei", "Malgun Gothic",
    "Arial Unicode MS", "Segoe UI Symbol", "Noto Emoji", "Symbola",
)  # fmt: skip
# Of the drawing of names, not of the results: a letter without a font is drawn as a box, a crowded figure as it is.
_UNTOLD = ("Glyph .* missing from", "constrained_layout not applied", "Tight layout not applied")

with resources.as_file(resources.files("vedette") / "paper.mplstyle") as _file:
    _SETTINGS: Any = dict(matplotlib.rc_params_from_file(_file, use_default_template=False))
for _name in ("axes.prop_cycle", "figure.figsize"):  # figures here have their own
    del _SETTINGS[_name]
_FORMATS = ("pdf", "svg", "png")
_DOTS_PER_INCH = 300
_POINTS_PER_INCH = 72.0
_AROUND_LABEL = 0.52  # inches, of the handle of an entry of a legend and the gaps beside it
_UNDATED: dict[str, dict[str, None]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}


def styled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Run `function` under the settings of these figures and leave Matplotlib's own as they were."""

    @wraps(function)
    def wrapper(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with matplotlib.rc_context({**_SETTINGS, "font.family": ["sans-serif", *_other_fonts()]}):
            return function(*args, **kwargs)

    return wrapper


@lru_cache(maxsize=1)
def _other_fonts() -> tuple[str, ...]:
    known = {font.name for font in font_manager.fontManager.ttflist if font.fname.lower().endswith(".ttf")}
    return tuple(name for name in _OTHER_FONTS if name in known)


@contextmanager
def _untold() -> Iterator[None]:
    """Draw without Matplotlib's warnings of letters that no font has and of crowded layouts."""
    with warnings.catch_warnings():
        for message in _UNTOLD:
            warnings.filterwarnings("ignore", message, UserWarning)
        yield


def new_figure(height: float, *, width: float = COLUMN_WIDTH) -> Figure:
    """An empty figure, in inches, that keeps its labels within its edges."""
    return Figure(figsize=(width, height), layout="constrained")


_LABELS = {
    "jdm": "JDM",
    "idm": "IDM",
    "nearest": "Nearest target",
    "assigned": "Assigned target",
    "centroid": "Centroid",
    "oracle": "Oracle",
    "told": "JDM, true targets",
    "random": "Random",
    "expected_loss": "Expected loss",
    "fixed": "Fixed",
    "still": "Not moving",
    "recorded": "Recorded scans",
    "delta_glmb": "delta-GLMB",
    "m_delta_glmb": "M-delta-GLMB",
    "factored_glmb": "factored GLMB",
    "lmb": "LMB",
    "phd": "PHD",
    "cphd": "CPHD",
    "cb_member": "CB-MeMBer",
    "cm_delta_glmb": "CM-delta-GLMB",
    "clmb": "CLMB",
    "central": "Central",
}


def strategy_label(name: str) -> str:
    """The name of a planner, a filter or a fusion as papers write it; any other name as it is."""
    return _LABELS.get(name, name)


def degrees_label(value: float) -> str:
    """A number of degrees with the minus sign that Matplotlib's own ticks have."""
    return with_minus(f"{value:.0f}")


def legend_columns(labels: Sequence[str], *, width: float = COLUMN_WIDTH) -> int:
    """How many entries of a legend stand side by side within a width in inches: at least one, at most six."""
    font = FontProperties(size=_SETTINGS["legend.fontsize"])
    with _untold():
        longest = max(
            (text_to_path.get_text_width_height_descent(label, font, False)[0] for label in labels), default=0
        )
    return max(1, min(6, len(labels), int((width - 0.2) / (_AROUND_LABEL + longest / _POINTS_PER_INCH))))


def span_times(axes: Axes, times: Floats) -> None:
    """Let the axis begin with the first time and end with the last; a single one gets a second to either side."""
    room = 0.0 if times[-1] > times[0] else 1.0
    axes.set_xlim(times[0] - room, times[-1] + room)


def colour(index: int) -> str:
    """Colour of the strategy at this place, the same in every figure."""
    return COLOURS[index % len(COLOURS)]


def sensor_looks(sensors: Sequence[int]) -> dict[int, tuple[str, str, Any]]:
    """Colour, marker and dashes of each sensor of a figure, no two of six alike.

    They are the same in every figure of at most six sensors, and no strategy has one of these colours.
    """
    are_few = max(sensors, default=0) < len(SENSOR_COLOURS)
    places = {sensor: sensor if are_few else place for place, sensor in enumerate(sensors)}
    return {
        sensor: (SENSOR_COLOURS[place % len(SENSOR_COLOURS)], MARKERS[place % len(MARKERS)], line_style(place))
        for sensor, place in places.items()
    }


def shown_decisions(number: int, most: int = 6) -> tuple[int, ...]:
    """Indices of at most `most` of `number` decisions, evenly spread, the first and the last among them."""
    if number <= most:
        return tuple(range(number))
    return tuple(round(place * (number - 1) / (most - 1)) for place in range(most))


def line_style(index: int) -> Any:
    """Dashes of the strategy at this place, the same in every figure."""
    return LINE_STYLES[index % len(LINE_STYLES)]


@styled
def save_figure(figure: Figure, path: Path | str, *, formats: Sequence[str] = _FORMATS) -> tuple[Path, ...]:
    """Write a figure once for each format, beside one another; the same figure gives the same bytes.

    Args:
        figure: what to draw.
        path: file name without its ending, in a folder that exists or can be made.
        formats: some of "pdf", "svg" (vector) and "png" (300 dots an inch).

    Returns the files written. Raises `InputError` for another format or a path that cannot be written.
    """
    unknown = [name for name in formats if name not in _FORMATS]
    if unknown:
        raise InputError(f"formats: expected some of {', '.join(_FORMATS)}; got {', '.join(unknown)}")
    stem = Path(path)
    try:
        stem.parent.mkdir(parents=True, exist_ok=True)
        with _as_it_is(figure):
            return tuple(_save(figure, stem.with_name(f"{stem.name}.{name}"), name) for name in formats)
    except OSError as error:
        raise InputError(
            f"path: expected a place to write figures; got {error.filename or stem}: {error.strerror}"
        ) from error


@styled
def svg_text(figure: Figure) -> str:
    """The figure as the text of an SVG file; the same figure gives the same text."""
    out = io.StringIO()
    with _as_it_is(figure):
        _print(figure, out, "svg")
    return out.getvalue()


@styled
def png_bytes(figure: Figure, *, dots_per_inch: float) -> bytes:
    """The figure as the bytes of a PNG file, for what has too many lines for `svg_text`; equal as there."""
    out = io.BytesIO()
    with _as_it_is(figure):
        figure.dpi = dots_per_inch
        _print(figure, out, "png")
    return out.getvalue()


@contextmanager
def _as_it_is(figure: Figure) -> Iterator[None]:
    """Leave the figure as it came. What draws it in the first format lays it out for all."""
    engine, dpi, canvas = figure.get_layout_engine(), figure.dpi, figure.canvas
    try:
        with _untold():
            yield
    finally:
        figure.set_canvas(canvas)
        figure.set_layout_engine(engine)
        figure.dpi = dpi


def _save(figure: Figure, path: Path, name: str) -> Path:
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    figure.dpi = _DOTS_PER_INCH  # of what is drawn in dots; printing a PDF or an SVG leaves another behind
    try:
        _print(figure, partial, name)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    figure.set_layout_engine("none")
    return path


def _print(figure: Figure, to: Any, name: str) -> None:
    """By the canvas of a format: `Figure.savefig` draws twice, the first time to lay out what this lays out itself."""
    canvas: Any = {"pdf": FigureCanvasPdf, "svg": FigureCanvasSVG, "png": FigureCanvasAgg}[name](figure)
    if name == "png":
        canvas.print_png(to)
    else:
        getattr(canvas, f"print_{name}")(to, metadata=_UNDATED[name])
