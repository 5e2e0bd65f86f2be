"""Files of figures without their contents, which take no time to write."""

from __future__ import annotations

import io
from importlib import import_module
from typing import Any

import pytest
from matplotlib.figure import Figure

STYLE = "vedette.evaluation.figures.style"


def print_nothing(patch: pytest.MonkeyPatch) -> None:
    """Write figures without their contents from now on."""
    patch.setattr(f"{STYLE}._print", _print_empty)


def print_svg(patch: pytest.MonkeyPatch) -> None:
    """Write the contents of figures as SVG alone from now on, and other formats without them."""
    printed = import_module(STYLE)._print

    def print_figure(figure: Figure, file: Any, name: str) -> None:
        (printed if name == "svg" else _print_empty)(figure, file, name)

    patch.setattr(f"{STYLE}._print", print_figure)


def _print_empty(figure: Figure, file: Any, name: str) -> None:
    file.write("<svg></svg>" if isinstance(file, io.StringIO) else b"empty figure")
