"""Common style of all figures: as wide as a paper's column, 8 pt, colours safe for colour blindness and grey print."""

import io
import shutil
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache, partial, wraps
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
from vedette.internal.files import write_file
from vedette.internal.text import with_minus
from vedette.kernels.base.types import Floats

_P = ParamSpec("_P")
_R = TypeVar("_R")

COLUMN_WIDTH = 3.5  # inches, of an IEEE column
TEXT_WIDTH = 7.16  # inches, of both columns

# M. Okabe and K. Ito, "Color Universal Design" (2008), without the yellow that is invisible on white; darkest last.
BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
# Colours of sensors, different from those of strategies: P. Tol's "muted" ones that are farthest, and two darker.
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
# Warnings about layout, not results: letters without a font are drawn as boxes, crowded figures unchanged.
_LAYOUT_WARNINGS = ("Glyph .* missing from", "constrained_layout not applied", "Tight layout not applied")

with resources.as_file(resources.files("vedette") / "paper.mplstyle") as _file:
    _SETTINGS: Any = dict(matplotlib.rc_params_from_file(_file, use_default_template=False))
for _name in ("axes.prop_cycle", "figure.figsize"):  # figures here set these themselves
    del _SETTINGS[_name]
_FORMATS = ("pdf", "svg", "png")
_DOTS_PER_INCH = 300
_POINTS_PER_INCH = 72.0
_LABEL_MARGIN = 0.52  # inches, width of a legend handle and the gaps next to it
_WITHOUT_DATE: dict[str, dict[str, None]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}


def styled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Run `function` with the settings of these figures and leave Matplotlib's own settings unchanged."""

    @wraps(function)
    def wrapper(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with matplotlib.rc_context({**_SETTINGS, "font.family": ["sans-serif", *_other_fonts()]}):
            return function(*args, **kwargs)

    return wrapper


@lru_cache(maxsize=1)
def _other_fonts() -> tuple[str, ...]:
    installed = {font.name for font in font_manager.fontManager.ttflist if font.fname.lower().endswith(".ttf")}
    return tuple(name for name in _OTHER_FONTS if name in installed)


@contextmanager
def _without_layout_warnings() -> Iterator[None]:
    """Draw without Matplotlib's warnings of missing letters and of crowded layouts."""
    with warnings.catch_warnings():
        for message in _LAYOUT_WARNINGS:
            warnings.filterwarnings("ignore", message, UserWarning)
        yield


def new_figure(height: float, *, width: float = COLUMN_WIDTH) -> Figure:
    """Return an empty figure that keeps its labels within its edges, with sizes in inches."""
    return Figure(figsize=(width, height), layout="constrained")


_LABELS = {
    "jdm": "JDM",
    "idm": "IDM",
    "nearest": "Nearest target",
    "assigned_target": "Assigned target",
    "centroid": "Centroid",
    "oracle": "Oracle",
    "true_targets": "JDM, true targets",
    "random": "Random",
    "expected_loss": "Expected loss",
    "constant": "Fixed",
    "stationary": "Not moving",
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
    """Return the name of a planner, a filter or a fusion as papers write it, and any other name unchanged."""
    return _LABELS.get(name, name)


def degrees_label(value: float) -> str:
    """Return a number of degrees with the minus sign of Matplotlib's ticks."""
    return with_minus(f"{value:.0f}")


def legend_columns(labels: Sequence[str], *, width: float = COLUMN_WIDTH) -> int:
    """Return the number of legend entries that fit next to each other in a width in inches: one to six."""
    font = FontProperties(size=_SETTINGS["legend.fontsize"])
    with _without_layout_warnings():
        longest = max(
            (text_to_path.get_text_width_height_descent(label, font, False)[0] for label in labels), default=0
        )
    return max(1, min(6, len(labels), int((width - 0.2) / (_LABEL_MARGIN + longest / _POINTS_PER_INCH))))


def span_times(axes: Axes, times: Floats) -> None:
    """Limit the axis to the first and the last time. A single time gets one second to either side."""
    margin = 0.0 if times[-1] > times[0] else 1.0
    axes.set_xlim(times[0] - margin, times[-1] + margin)


def colour(index: int) -> str:
    """Return the colour of the strategy at this index, the same in every figure."""
    return COLOURS[index % len(COLOURS)]


def sensor_styles(sensors: Sequence[int]) -> dict[int, tuple[str, str, Any]]:
    """Return colour, marker and dashes of each sensor of a figure. Those of six sensors all differ.

    They are the same in every figure of at most six sensors, and no strategy has one of these colours.
    """
    have_own = max(sensors, default=0) < len(SENSOR_COLOURS)
    indices = {sensor: sensor if have_own else index for index, sensor in enumerate(sensors)}
    return {
        sensor: (SENSOR_COLOURS[index % len(SENSOR_COLOURS)], MARKERS[index % len(MARKERS)], line_style(index))
        for sensor, index in indices.items()
    }


def shown_decisions(number: int, max_shown: int = 6) -> tuple[int, ...]:
    """Return indices of at most `max_shown` of `number` decisions, evenly spread, with the first and the last."""
    if number <= max_shown:
        return tuple(range(number))
    return tuple(round(index * (number - 1) / (max_shown - 1)) for index in range(max_shown))


def line_style(index: int) -> Any:
    """Return the dashes of the strategy at this index, the same in every figure."""
    return LINE_STYLES[index % len(LINE_STYLES)]


@styled
def save_figure(figure: Figure, path: Path | str, *, formats: Sequence[str] = _FORMATS) -> tuple[Path, ...]:
    """Write a figure once for each format, into one folder. The same figure gives the same bytes.

    Args:
        figure: to be drawn.
        path: file name without its ending, in a folder that exists or can be made.
        formats: some of "pdf", "svg" (vector) and "png" (300 dots per inch).

    Returns the files written. Raises `InputError` for another format or a path that cannot be written.
    """
    unknown = [name for name in formats if name not in _FORMATS]
    if unknown:
        raise InputError(f"formats: expected some of {', '.join(_FORMATS)}; got {', '.join(unknown)}")
    stem = Path(path)
    files = [stem.with_name(f"{stem.name}.{name}") for name in formats]
    with _restored(figure):
        drawn = [_drawn(figure, name) for name in formats]  # in memory, as matplotlib reports a full disk in pages
    for file, content in zip(files, drawn, strict=True):
        write_file(file, partial(shutil.copyfileobj, content), make_folder=True)
    return tuple(files)


@styled
def svg_text(figure: Figure) -> str:
    """Return the figure as the text of an SVG file. The same figure gives the same text."""
    out = io.StringIO()
    with _restored(figure):
        _print(figure, out, "svg")
    return out.getvalue()


@styled
def png_bytes(figure: Figure, *, dots_per_inch: float) -> bytes:
    """Return the figure as the bytes of a PNG file, reproducibly, for figures with too many lines for `svg_text`."""
    out = io.BytesIO()
    with _restored(figure):
        figure.dpi = dots_per_inch
        _print(figure, out, "png")
    return out.getvalue()


@contextmanager
def _restored(figure: Figure) -> Iterator[None]:
    """Restore the figure's settings afterwards. Drawing the first format lays the figure out for all."""
    engine, dpi, canvas = figure.get_layout_engine(), figure.dpi, figure.canvas
    try:
        with _without_layout_warnings():
            yield
    finally:
        figure.set_canvas(canvas)
        figure.set_layout_engine(engine)
        figure.dpi = dpi


def _drawn(figure: Figure, name: str) -> io.BytesIO:
    """Return the file of a figure in a format, and keep its layout for further ones."""
    out = io.BytesIO()
    figure.dpi = _DOTS_PER_INCH  # for raster parts; printing a PDF or an SVG changes it
    _print(figure, out, name)
    figure.set_layout_engine("none")
    out.seek(0)
    return out


def _print(figure: Figure, file: Any, name: str) -> None:
    """Print with the canvas of a format: `Figure.savefig` would draw twice, the first time only for the layout."""
    canvas: Any = {"pdf": FigureCanvasPdf, "svg": FigureCanvasSVG, "png": FigureCanvasAgg}[name](figure)
    if name == "png":
        canvas.print_png(file)
    else:
        getattr(canvas, f"print_{name}")(file, metadata=_WITHOUT_DATE[name])
