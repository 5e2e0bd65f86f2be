"""Labels of strategies in figures: as papers write them, short enough for a legend."""

from collections.abc import Sequence

from vedette.evaluation.figures.style import strategy_label
from vedette.internal.text import elided, elided_apart


def short_labels(names: Sequence[str], max_width: int = 24) -> tuple[str, ...]:
    """Return a label for each strategy, ready to draw, each at most `max_width` letters wide and no two alike."""
    return tuple(map(drawn_text, elided_apart([strategy_label(name) for name in names], max_width)))


def short_label(name: str, max_width: int = 24) -> str:
    """Return the label of one strategy, at most `max_width` letters wide."""
    return drawn_text(elided(strategy_label(name), max_width))


def elided_names(names: Sequence[str]) -> dict[str, str]:
    """Return, for each name that is too long to be drawn, its label and the name."""
    full = [strategy_label(name) for name in names]
    return {short: name for short, name in zip(elided_apart(full), full, strict=True) if short != name}


def drawn_text(text: str) -> str:
    """Return text that Matplotlib draws unchanged: no formulas between dollars, no hidden leading underscore."""
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text
