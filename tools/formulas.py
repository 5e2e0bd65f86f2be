"""Formulas of the documentation as MathML, which browsers draw by themselves, without a network or a script.

A Markdown extension, for what `pymdownx.arithmatex` makes of $...$ and $$...$$.
"""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.postprocessors import Postprocessor

# \\(...\\) in a span, \\[...\\] in a div.
_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


class Typeset(Postprocessor):  # type: ignore[misc]
    """Puts MathML where formulas are."""

    def run(self, text: str) -> str:
        """The page with its formulas typeset."""
        return _FORMULA.sub(_typeset, text)


def _typeset(formula: re.Match[str]) -> str:
    _, opening, latex = formula.groups()
    if opening == "[":
        return f'<div class="formula">{convert(html.unescape(latex), display="block")}</div>'
    return convert(html.unescape(latex))


class Formulas(Extension):  # type: ignore[misc]
    """See the module."""

    def extendMarkdown(self, md: Markdown) -> None:
        """After everything else."""
        md.postprocessors.register(Typeset(md), "formulas", 0)


def makeExtension(**_: object) -> Formulas:
    """What Markdown calls by this name."""
    return Formulas()
