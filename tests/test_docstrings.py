"""Docstrings say what is there: sentences end, sections stand in order, and every name that is described exists."""

from __future__ import annotations

import ast
import itertools
import re

import pytest

from docstrings import HEADINGS, Documented, Function, attributes, documented, names_in, parameters, sections_of

EVERYTHING = list(documented())
WITH_TEXT = [entry for entry in EVERYTHING if entry.text]
CLASSES = {entry.node.name: entry.node for entry in EVERYTHING if isinstance(entry.node, ast.ClassDef)}


def unfinished(text: str) -> list[str]:
    """The paragraphs and entries that do not end as a sentence does."""
    sections = sections_of(text)
    ends = [f"{name}: {said}" for entries in sections.values() for name, said in entries]
    paragraphs = [*text.split("\n\n"), ""]
    for paragraph, following in itertools.pairwise(paragraphs):
        last = paragraph.splitlines()[-1]
        if following.startswith(" "):  # a formula or code is part of the sentence
            continue
        if not last.startswith((" ", "|")) and last.rstrip(":") not in HEADINGS:
            ends.append(paragraph)
    return [end for end in ends if not end.rstrip().endswith((".", ":", "?", ".)", '."'))]


def test_the_source_is_read() -> None:
    assert len(WITH_TEXT) > 800
    assert sum(bool(entry.sections) for entry in WITH_TEXT) > 150


@pytest.mark.parametrize(
    "text",
    [
        "Half a",
        "One.\n\nArgs:\n    a: so much of\n    b: all.",
        "One.\n\nThen some",
        "One.\n\nArgs:\n    a: x that is\n        cut",
    ],
)
def test_a_sentence_that_is_cut_is_found(text: str) -> None:
    assert unfinished(text)


def test_sentences_end() -> None:
    assert {entry.place: unfinished(entry.text or "") for entry in WITH_TEXT if unfinished(entry.text or "")} == {}


def test_no_entry_is_cut_in_two() -> None:
    """A description goes on indented further, and nothing in a section stands where a name should."""
    found = {}
    for entry in WITH_TEXT:
        for heading in ("Args", "Attributes"):
            odd = [name for name in names_in(entry.sections.get(heading, [])) if not name.isidentifier()]
            if odd:
                found[entry.place] = odd
    assert found == {}


def test_sections_stand_in_order() -> None:
    wrong = {}
    for entry in WITH_TEXT:
        order = [HEADINGS.index(heading) for heading in entry.sections]
        if order != sorted(order):
            wrong[entry.place] = list(entry.sections)
    assert wrong == {}


def described(entry: Documented) -> tuple[set[str], set[str]]:
    """Names that a docstring describes and that are not there, and those that it leaves out of a list it gives."""
    if isinstance(entry.node, Function):
        given, there = entry.sections.get("Args"), parameters(entry.node)
        wanted = there
    elif isinstance(entry.node, ast.ClassDef):
        given, fields = entry.sections.get("Attributes"), attributes(entry.node, CLASSES)
        there, wanted = list(fields), [name for name, declared in fields.items() if declared]
    else:
        return set(), set()
    if given is None:
        return set(), set()
    names = set(names_in(given))
    return names - set(there), {name for name in wanted if not name.startswith("_")} - names


def test_what_is_described_exists() -> None:
    assert {entry.place: missing for entry in WITH_TEXT if (missing := described(entry)[0])} == {}


def test_the_fields_that_a_named_tuple_describes_exist() -> None:
    """These begin a line with the names of fields, without a heading."""
    wrong = {}
    for entry in WITH_TEXT:
        if isinstance(entry.node, ast.ClassDef) and "NamedTuple" in map(ast.unparse, entry.node.bases):
            begun = re.findall(r"^(\w+(?:, \w+)*): ", entry.text or "", re.MULTILINE)
            names = {name for group in begun for name in group.split(", ")} - set(HEADINGS)
            if unknown := names - set(attributes(entry.node, CLASSES)):
                wrong[entry.place] = unknown
    assert wrong == {}


def test_headings_stand_alone() -> None:
    """What follows one on its line is taken for prose, and is no list in the reference."""
    heads = "|".join(HEADINGS)
    assert [entry.place for entry in WITH_TEXT if re.search(rf"^({heads}): \S", entry.text or "", re.MULTILINE)] == []


def test_a_list_of_parameters_or_attributes_is_whole() -> None:
    assert {entry.place: left for entry in WITH_TEXT if entry.is_public and (left := described(entry)[1])} == {}


def test_everything_public_has_a_docstring() -> None:
    """What has none is not shown in the reference, such as the one method of a protocol."""
    bare = [entry.place for entry in EVERYTHING if entry.is_public and not entry.text]
    assert [place for place in bare if "__" not in place.rsplit(": ", 1)[-1]] == []
