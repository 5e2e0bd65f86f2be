"""What the documentation generates from the source while it is built (mkdocs calls these by name)."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert

FIELDS_MARK = "<!-- scenario fields -->"

# What `pymdownx.arithmatex` makes of $...$ and $$...$$: \\(...\\) in a span, \\[...\\] in a div.
_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the field tables of scenario files where a page asks for them."""
    return markdown.replace(FIELDS_MARK, field_tables()) if FIELDS_MARK in markdown else markdown


def on_page_content(content: str, **_: Any) -> str:
    """Typeset formulas: as MathML, which browsers draw by themselves, without a network."""
    return _FORMULA.sub(_typeset, content)


def _typeset(formula: re.Match[str]) -> str:
    _, opening, latex = formula.groups()
    if opening == "[":
        return f'<div class="formula">{convert(html.unescape(latex), display="block")}</div>'
    return convert(html.unescape(latex))


def on_post_build(config: Mapping[str, Any], **_: Any) -> None:
    """Write the search index as a script too: a page that is opened from disk can load nothing else."""
    folder = Path(config["site_dir"]) / "search"
    index = (folder / "search_index.json").read_text("utf-8")
    (folder / "index.js").write_text(f"window.searchIndex = {index};\n", "utf-8")


def field_tables() -> str:
    """A table of fields for each section of a scenario file, from its JSON schema."""
    from vedette.scenarios import json_schema

    schema = json_schema()
    sections = {"The file": schema, **schema["$defs"]}
    return "\n\n".join(_section(name, section) for name, section in sections.items() if "properties" in section)


def _section(name: str, section: Mapping[str, Any]) -> str:
    rows = []
    for field, details in section["properties"].items():
        default = "required" if field in section.get("required", []) else _default(details)
        rows.append(f"| `{field}` | {_kind(details)} | {default} | {_cell(details.get('description', ''))} |")
    text = _cell(section.get("description", ""))
    head = ["| field | type | default | meaning |", "| --- | --- | --- | --- |"]
    return "\n".join([f"### {name}", "", text, "", *head, *rows])


def _kind(details: Mapping[str, Any]) -> str:
    if "$ref" in details:
        name = details["$ref"].rsplit("/", 1)[-1]
        return f"[{name}](#{name.lower()})"
    if "const" in details:
        return f"`{json.dumps(details['const'])}`"
    if "enum" in details:
        return ", ".join(f"`{value}`" for value in details["enum"])
    for key in ("anyOf", "oneOf", "allOf"):
        if key in details:
            return " or ".join(_kind(option) for option in details[key])
    if details.get("type") == "array":
        items = details.get("prefixItems") or [details.get("items", {})]
        return f"list of {' and '.join(dict.fromkeys(_kind(item) for item in items))}"
    return str(details.get("type", "any"))


def _default(details: Mapping[str, Any]) -> str:
    default = json.dumps(details.get("default"))
    return f"`{default}`" if len(default) <= 60 else "as its section says"


def _cell(text: str) -> str:
    return html.escape(" ".join(text.split()), quote=False).replace("|", "\\|")
