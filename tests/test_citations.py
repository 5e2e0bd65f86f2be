"""What the code and the documentation cite of the paper is there, and so are the notes on it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NOTES = (ROOT / "docs/paper-notes.md").read_text("utf-8")
SECTIONS = {"II-A", "II-B", "II-C", "II-D", "III-A", "III-B", "IV"}
NUMBERED = {"Algorithm": range(1, 4), "Fig.": range(1, 6)}


def cited(pattern: str) -> Iterator[tuple[str, str]]:
    """File, and what the pattern's group finds in it, over code and documentation; a citation may run over a line."""
    for folder in ("src", "docs", "tests", "examples"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".md", ".yaml") and path != Path(__file__):
                text = re.sub(r"\s+#?\s*", " ", path.read_text("utf-8"))
                yield from ((str(path.relative_to(ROOT)), found) for found in re.findall(pattern, text))


def equations() -> set[int]:
    """The equations that the page of notes lists."""
    rows = re.findall(r"^\| ([0-9, ]+) \| .* \| (\S+) \|$", NOTES, re.MULTILINE)
    assert {section for _, section in rows} <= SECTIONS
    return {int(number) for numbers, _ in rows for number in numbers.split(",")}


def test_every_note_that_is_cited_is_there() -> None:
    notes = {int(number) for number in re.findall(r"^### (\d+)\. ", NOTES, re.MULTILINE)}
    anchors = {int(number) for number in re.findall(r"\{ #note-(\d+) \}$", NOTES, re.MULTILINE)}
    assert notes == anchors == set(range(1, 19))
    found = list(cited(r"paper-notes ([^\s.,;)\"]+)"))
    assert len(found) > 10
    for path, number in found:
        assert number.isdigit(), f"{path}: paper-notes {number}"
        assert int(number) in notes, f"{path}: paper-notes {number}"


def test_every_equation_that_is_cited_is_there() -> None:
    known = equations()
    assert known == set(range(1, 18))
    found = list(cited(r"paper(?:'s)?,? eqs?\. ([0-9]+(?:(?:, | and | to )[0-9]+)*)"))
    assert len(found) > 10
    for path, numbers in found:
        assert {int(number) for number in re.findall(r"\d+", numbers)} <= known, f"{path}: eq. {numbers}"


def test_every_section_algorithm_and_figure_that_is_cited_is_there() -> None:
    sections = list(cited(r"paper,? section ([IV]+(?:-[A-Z])?)"))
    assert len(sections) > 5
    assert [entry for entry in sections if entry[1] not in SECTIONS] == []
    for kind, known in NUMBERED.items():
        found = list(cited(rf"paper,? {re.escape(kind)} (\d+)"))
        assert found
        assert [entry for entry in found if int(entry[1]) not in known] == []


def test_the_reward_names_the_equations_that_define_it() -> None:
    (numbers,) = {n for path, n in cited(r"paper eqs\. (5[^)]*)") if path.endswith("rewards/power.py")}
    assert numbers == "5, 8 and 13 to 17"
