"""Tables of the fields of scenario files, for the pages of docs/fields/.

A mark such as `<!-- fields: motion survival ScanTimes -->` is replaced by tables of the sections that are allowed in
these fields (`motion`, `sensors.noise`) or have these names; `Scenario` is the file itself.
`<!-- every section -->` is replaced by an index.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

MARK = re.compile(r"<!-- fields: (.+?) -->", re.DOTALL)
INDEX_MARK = "<!-- every section -->"


class FieldPages:
    """The sections on each page."""

    def __init__(self, docs: Path) -> None:
        self.pages = {
            path.name: [name for found in marks for name in expand(found)]
            for path in sorted((docs / "fields").glob("*.md"))
            if (marks := MARK.findall(path.read_text("utf-8")))
        }
        self._home = {name: page for page, names in self.pages.items() for name in names}

    def faults(self) -> list[str]:
        """Return messages on sections that no page has, or several pages have."""
        every = [name for names in self.pages.values() for name in names]
        twice = [name for name in dict.fromkeys(every) if every.count(name) > 1]
        return [
            *(f"docs/fields: no page has the section {name}" for name in sections() if name not in every),
            *(f"docs/fields: {name} is on more than one page" for name in twice),
        ]

    def fill(self, markdown: str) -> str:
        """Return a page with its marks replaced by tables."""
        markdown = MARK.sub(lambda mark: "\n\n".join(map(self._section, expand(mark[1]))), markdown)
        return markdown.replace(INDEX_MARK, self._index()) if INDEX_MARK in markdown else markdown

    def _section(self, name: str) -> str:
        section, rows = sections()[name], []
        for field, details in section["properties"].items():
            default = "required" if field in section.get("required", []) else _default(details)
            rows.append(f"| `{field}` | {_cell(details.get('description', ''))} | {self._kind(details)} | {default} |")
        text = _cell(section.get("description", ""))
        head = ["| field | meaning | type | default |", "| --- | --- | --- | --- |"]
        return "\n".join([f"## {title(name)} {{#{name.lower()}}}", "", text, "", *head, *rows])

    def _index(self) -> str:
        rows = [f"| {self._link(name)} | {_cell(sections()[name].get('description', ''))} |" for name in self._home]
        return "\n".join(["| section | meaning |", "| --- | --- |", *rows])

    def _link(self, name: str) -> str:
        return f"[{title(name)}]({self._home[name]}#{name.lower()})" if name in self._home else title(name)

    def _kind(self, details: Mapping[str, Any]) -> str:
        if "$ref" in details:
            return self._link(details["$ref"].rsplit("/", 1)[-1])
        if "const" in details:
            return f"`{json.dumps(details['const'])}`"
        if "enum" in details:
            return ", ".join(f"`{value}`" for value in details["enum"])
        for key in ("anyOf", "oneOf", "allOf"):
            if key in details:
                return " or ".join(self._kind(option) for option in details[key])
        if details.get("type") == "array":
            items = details.get("prefixItems") or [details.get("items", {})]
            return f"list of {' and '.join(dict.fromkeys(self._kind(item) for item in items))}"
        if isinstance(details.get("additionalProperties"), dict) and "JsonValue" not in str(details):
            return f"by name, {self._kind(details['additionalProperties'])}"
        return str(details.get("type", "any"))


@cache
def sections() -> dict[str, Any]:
    """Return every section of a scenario file with fields, from the JSON schema."""
    from vedette.scenarios import json_schema

    schema = json_schema()
    return {name: one for name, one in {"Scenario": schema, **schema["$defs"]}.items() if "properties" in one}


def expand(mark: str) -> list[str]:
    """Return the names of the sections of a mark."""
    return [name for word in mark.split() for name in ([word] if word in sections() else standing_in(word))]


def standing_in(path: str) -> list[str]:
    """Return the names of the sections that are allowed in a field, given by its path from the top of a file."""
    names = ["Scenario"]
    for part in path.split("."):
        holders = [sections()[name]["properties"] for name in names]
        names = list(dict.fromkeys(name for one in holders if part in one for name in _named(one[part])))
    if not names:
        raise ValueError(f"docs/fields: expected the name of a section or the path of a field; got {path!r}")
    return names


def title(name: str) -> str:
    """Return the name of a section in a file: its kind, if it has one."""
    kind = sections()[name]["properties"].get("kind", {})
    return f"`{kind['const']}`" if "const" in kind else {"Scenario": "The file"}.get(name, name.removesuffix("Section"))


def _named(details: Any) -> Iterator[str]:
    if isinstance(details, dict):
        if "$ref" in details:
            yield details["$ref"].rsplit("/", 1)[-1]
        for key, value in details.items():
            yield from _named(value) if key != "discriminator" else ()
    elif isinstance(details, list):
        for value in details:
            yield from _named(value)


def _default(details: Mapping[str, Any]) -> str:
    default = json.dumps(details.get("default"))
    return f"`{default}`" if len(default) <= 60 else "see its section"


def _cell(text: str) -> str:
    return html.escape(" ".join(text.split()), quote=False).replace("|", "\\|")
