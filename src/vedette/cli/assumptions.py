"""Printing of the assumptions that replace sections missing from a sensors file."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Mapping
from pathlib import Path

from vedette.cli.output import note

_MAX_WIDTH = 120


def note_assumptions(assumed: Mapping[str, str], sensors: Path) -> None:
    """Print each assumed section and its description, as one aligned block on standard error."""
    if not assumed:
        return
    note(f"Assumed, because {sensors} does not give it:")
    width = min(shutil.get_terminal_size().columns, _MAX_WIDTH)
    for section, text in assumed.items():
        first = f"  {section:<10}  "
        note(textwrap.fill(text, width, initial_indent=first, subsequent_indent=" " * len(first)))
