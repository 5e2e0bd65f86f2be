"""The pages of scenario fields: every section on one of them, and every example as good as a user's own file."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from scenarios.minimal import MINIMAL
from scripts import load
from vedette.scenarios import json_schema, parse_scenario

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs" / "fields").glob("*.md"))
BLOCKS = [
    pytest.param(block, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, block in enumerate(re.findall(r"```yaml\n(.*?)```", page.read_text("utf-8"), re.DOTALL))
]


def in_a_file(block: str) -> str:
    """An example as part of a small scenario: its sections in place of those that the file has."""
    yaml, text = YAML(typ="safe", pure=True), io.StringIO()
    own: dict[str, Any] = yaml.load(block)
    others = {name: one for name, one in yaml.load(MINIMAL).items() if name not in ("filter", "fusion")}
    if "sensors" in own:
        del others["sensor_defaults"]
    yaml.dump(own if "name" in own else others | own, text)
    return text.getvalue()


@pytest.mark.parametrize("block", BLOCKS)
def test_every_example_is_read(block: str) -> None:
    parse_scenario(in_a_file(block), folder=ROOT / "examples" / "recording")


def test_every_kind_and_field_that_is_no_code_has_an_example() -> None:
    shown = "\n".join(str(block.values[0]) for block in BLOCKS)
    kind_fields = [
        one["properties"]["kind"] for one in json_schema()["$defs"].values() if "kind" in one.get("properties", {})
    ]
    named = {kind["const"] for kind in kind_fields if "const" in kind} - {"custom"}
    assert {kind for kind in named if f"kind: {kind}" not in shown} == set()
    assert {field for field in json_schema()["properties"] if f"{field}:" not in shown} == {
        "format",
        "description",
        "coastline",
    }


def test_every_section_is_on_one_page(monkeypatch: pytest.MonkeyPatch) -> None:
    fields = load("tools/docs_fields.py")
    pages = fields.FieldPages(ROOT / "docs")
    assert pages.faults() == []
    filled = "".join(pages.fill(page.read_text("utf-8")) for page in PAGES)
    assert "<!--" not in filled
    for name, section in fields.sections().items():
        _, _, table = filled.partition(f"{{#{name.lower()}}}")
        assert all(f"\n| `{field}` |" in table for field in section["properties"]), name


def test_a_section_without_a_page_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "fields").mkdir()
    (tmp_path / "fields" / "one.md").write_text("<!-- fields: motion Time -->\n\n<!-- fields: Time -->\n", "utf-8")
    told = load("tools/docs_fields.py").FieldPages(tmp_path).faults()
    assert "docs/fields: no page has the section Ospa" in told
    assert "docs/fields: Time is on more than one page" in told
    assert not any("ConstantVelocityMotion" in fault for fault in told)
    with pytest.raises(ValueError, match="expected the name of a section or the path of a field; got 'motoin'"):
        load("tools/docs_fields.py").expand("motoin")
