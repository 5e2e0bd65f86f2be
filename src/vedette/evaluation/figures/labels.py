"""What figures call strategies: as papers write them, short enough for a legend."""

from __future__ import annotations

from collections.abc import Sequence

from vedette.evaluation.figures.style import strategy_label
from vedette.internal.text import elided, elided_apart


def short_labels(names: Sequence[str], most: int = 24) -> tuple[str, ...]:
    """A label a strategy, each at most `most` letters wide and no two alike, fit to be drawn."""
    return tuple(map(drawn_text, elided_apart([strategy_label(name) for name in names], most)))


def short_label(name: str, most: int = 24) -> str:
    """One such label."""
    return drawn_text(elided(strategy_label(name), most))


def elided_names(names: Sequence[str]) -> dict[str, str]:
    """Of the names that are too long to be drawn, the label that stands for each, and the name."""
    full = [strategy_label(name) for name in names]
    return {short: name for short, name in zip(elided_apart(full), full, strict=True) if short != name}


def drawn_text(text: str) -> str:
    """Text that Matplotlib draws as it is: no formulas between dollars, no hiding of what begins with an underscore."""
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text
