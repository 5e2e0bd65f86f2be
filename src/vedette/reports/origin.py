"""What a campaign was run with, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vedette.reports.tables import Table


def versions_table(manifest: Mapping[str, Any]) -> Table:
    """Start, versions and machine of each session that ran a part of the campaign, a column a session.

    Sessions in a row that differ in nothing but their start share a column.
    """
    columns: list[tuple[list[str], dict[str, str]]] = []
    for session in manifest.get("sessions", ()):
        facts = _facts(session)
        if not columns or columns[-1][1] != facts:
            columns.append(([], facts))
        columns[-1][0].append(str(session.get("started", "")))
    names = list(dict.fromkeys(name for _, facts in columns for name in facts))
    rows = [("started", *(_span(starts) for starts, _ in columns))]
    rows += [(name, *(facts.get(name, "\N{EN DASH}") for _, facts in columns)) for name in names]
    caption = f"Made {manifest.get('created', '')}; digest of specification and scenarios {manifest.get('digest', '')}."
    return Table(caption, ("", *_headings([len(starts) for starts, _ in columns])), tuple(rows), is_words=True)


def _facts(session: Mapping[str, Any]) -> dict[str, str]:
    parts = {**session.get("versions", {}), **session.get("machine", {})}
    return {name: str(value) for name, value in parts.items()}


def _span(starts: list[str]) -> str:
    return starts[0] if len(starts) == 1 else f"{starts[0]} to {starts[-1]}"


def _headings(lengths: list[int]) -> list[str]:
    headings, first = [], 1
    for length in lengths:
        headings.append(f"Session {first}" if length == 1 else f"Sessions {first} to {first + length - 1}")
        first += length
    return headings
