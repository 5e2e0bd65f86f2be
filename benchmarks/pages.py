"""Tables in the pages of the documentation."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

END = "<!-- to here -->"


def write_between(path: Path, script: str, text: str) -> None:
    """Put a table in the place that a page keeps for the script that makes it."""
    page, begin = path.read_text(encoding="utf-8"), f"<!-- from benchmarks/{script} -->"
    if begin not in page or END not in page.split(begin)[1]:
        raise SystemExit(f"{path}: expected the lines {begin} and {END}")
    before, rest = page.split(begin, 1)
    path.write_text(f"{before}{begin}\n\n{text}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def table_of_scenes(words: str | None, script: str, table: Callable[[int, int], str]) -> None:
    """Run a benchmark from the command line: print its table, or write it into a page as well.

    table: of a number of scenes and the seed of the first, as Markdown. words: the help text.
    """
    parser = argparse.ArgumentParser(description=words, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20, help="scenes a row")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--write", type=Path, help="page to write the table into")
    given = parser.parse_args()
    found = table(given.runs, given.first)
    print(found)
    if given.write is not None:
        write_between(given.write, script, found)
