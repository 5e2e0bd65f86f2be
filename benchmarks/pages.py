"""Tables in the pages of the documentation."""

from __future__ import annotations

from pathlib import Path

END = "<!-- to here -->"


def write_between(path: Path, script: str, text: str) -> None:
    """Put a table in the place that a page keeps for the script that makes it."""
    page, begin = path.read_text(encoding="utf-8"), f"<!-- from benchmarks/{script} -->"
    if begin not in page or END not in page.split(begin)[1]:
        raise SystemExit(f"{path}: expected the lines {begin} and {END}")
    before, rest = page.split(begin, 1)
    path.write_text(f"{before}{begin}\n\n{text}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")
