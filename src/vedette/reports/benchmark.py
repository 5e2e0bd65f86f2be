"""The results of a benchmark as one HTML file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from vedette.campaigns.leaderboard import SceneTable, header, row
from vedette.reports.html import prepare_folder, render, write_page
from vedette.reports.tables import Table

_NOTE = "All on the same runs; 95 %: interval, of skewed differences by bootstrap. A lost run counts as the cutoff."


def write_benchmark(tables: Sequence[SceneTable], facts: Mapping[str, str], path: Path) -> None:
    """Write the page of a benchmark. Raises `InputError` if it cannot be written.

    facts: versions and checksums by name.
    """
    prepare_folder(path)
    named = [
        (table, Table(_NOTE, header(table), tuple(row(table, each) for each in table.standings))) for table in tables
    ]
    of_what = Table(
        "Versions, and SHA-256 of scenes and entrants.", ("What", "Value"), tuple(facts.items()), is_words=True
    )
    write_page(path, render("benchmark.html", [], scripts=(), tables=named, facts=of_what))
